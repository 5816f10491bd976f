#include <components/iridium/address_list.hpp>

#include <components/iridium/text.hpp>

#include <ise/core/endpoint.hpp>

#include <asio/ip/address.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <system_error>

namespace atirma::iridium {
namespace {

std::optional<asio::ip::address> numeric(std::string_view text) {
    std::error_code wrong;
    auto read = asio::ip::make_address(std::string(text), wrong);
    if (wrong) return std::nullopt;
    return read;
}

std::array<std::uint8_t, 16> wide(const asio::ip::address& at) {
    return at.is_v4() ? asio::ip::make_address_v6(asio::ip::v4_mapped, at.to_v4()).to_bytes() : at.to_v6().to_bytes();
}

} // namespace

ise::result<address_list> address_list::parse(std::string_view text) {
    address_list made;
    while (!text.empty()) {
        auto part = text.substr(0, text.find(','));
        text.remove_prefix(std::min(part.size() + 1, text.size()));
        while (!part.empty() && part.front() == ' ') part.remove_prefix(1);
        while (!part.empty() && part.back() == ' ') part.remove_suffix(1);
        auto slash = part.find('/');
        auto read = numeric(part.substr(0, slash));
        auto widest = read && read->is_v4() ? 32 : 128;
        auto bits = slash == std::string_view::npos
                        ? ise::result<std::int64_t>(widest)
                        : parse_integer("the length of a prefix", part.substr(slash + 1), 0, widest);
        if (!read || !bits)
            return ise::failure(
                ise::errc::invalid_argument,
                fmt::format("'{}' is neither an address nor a network, such as 12.47.179.11 or 192.0.2.0/24", part));
        network one;
        one.first = wide(*read);
        one.bits = static_cast<unsigned>(*bits + 128 - widest);
        made.networks_.push_back(one);
    }
    return made;
}

bool address_list::accepts(std::string_view peer) const {
    if (empty()) return true;
    auto at = ise::endpoint::parse(peer);
    auto read = at ? numeric(at->host) : std::nullopt;
    if (!read) return false;
    auto bytes = wide(*read);
    auto within = [&](const network& one) {
        for (unsigned bit = 0; bit < one.bits; ++bit)
            if (((bytes[bit / 8] ^ one.first[bit / 8]) >> (7 - bit % 8) & 1) != 0) return false;
        return true;
    };
    return std::any_of(networks_.begin(), networks_.end(), within);
}

} // namespace atirma::iridium
