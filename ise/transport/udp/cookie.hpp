#pragma once
#include <ise/core/environment.hpp>
#include <ise/wire/datagram.hpp>

#include <array>
#include <string_view>

namespace ise::net::udp {

using secret = std::array<std::uint64_t, 2>;

/// SipHash-2-4: a short keyed hash that nobody forges without the key.
std::uint64_t keyed_hash(const secret& key, bytes_view text) noexcept;

/// Proves that a stranger receives at the address it sends from, without remembering it: what it is asked to show is
/// a keyed hash of that address, of the id that it chose and of the time. The key is drawn from the environment and
/// changes; the one before is accepted for as long as a cookie lives.
class cookie_jar {
public:
    /// How long a cookie is accepted.
    static constexpr duration lifetime = std::chrono::seconds(10);

    explicit cookie_jar(environment& env);
    wire::cookie bake(const endpoint& stranger, std::uint64_t id, time_point now);
    bool accepts(const wire::cookie& shown, const endpoint& stranger, std::uint64_t id, time_point now);

private:
    void turn(time_point now);
    std::uint64_t seal(const secret& key, const endpoint& stranger, std::uint64_t id, std::uint64_t stamp) const;

    environment& env_;
    secret key_;
    secret former_;
    time_point drawn_{};
};

} // namespace ise::net::udp
