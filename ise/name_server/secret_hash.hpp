#pragma once
#include <ise/transport/udp/cookie.hpp>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <unordered_map>

namespace ise {

/// Hashes what peers choose: without the secret nobody finds many that collide.
class secret_hash {
public:
    explicit secret_hash(const net::udp::secret& by) : secret_(by) {}

    // Not noexcept: libstdc++ then keeps what they give.
    std::size_t operator()(std::string_view text) const { return hash(as_bytes(text)); }
    std::size_t operator()(std::uint64_t number) const { return hash(std::as_bytes(std::span(&number, 1))); }

private:
    std::size_t hash(bytes_view of) const { return static_cast<std::size_t>(net::udp::keyed_hash(secret_, of)); }

    net::udp::secret secret_;
};

/// By a number that peers choose.
template <class T>
using by_number = std::unordered_map<std::uint64_t, T, secret_hash>;

} // namespace ise
