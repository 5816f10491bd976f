#pragma once
#include <ise/core/result.hpp>

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

namespace atirma::iridium {

/// Addresses from which connections are accepted. An empty list accepts all.
class address_list {
public:
    address_list() = default;
    /// "12.47.179.11, 192.0.2.0/24, 2001:db8::/32". Error: invalid_argument, naming the part that is wrong.
    static ise::result<address_list> parse(std::string_view text);

    bool empty() const noexcept { return networks_.empty(); }
    /// `peer` as ise::stream tells it: "tcp://12.47.179.11:40112".
    bool accepts(std::string_view peer) const;

private:
    using address = std::array<std::uint8_t, 16>; // IPv4 within IPv6
    struct network {
        address first{};
        unsigned bits = 128;
    };
    std::vector<network> networks_;
};

} // namespace atirma::iridium
