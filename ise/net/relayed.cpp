#include <ise/net/relayed.hpp>

#include <asio/ip/address.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::net {
namespace {

// Of the several spellings of an address one; a name as it is.
std::string spelled_once(const std::string& host) {
    std::error_code none;
    auto address = asio::ip::make_address(host, none);
    if (none) return host;
    if (!address.is_v6()) return address.to_string();
    auto wide = address.to_v6();
    if (wide.is_v4_mapped()) return asio::ip::make_address_v4(asio::ip::v4_mapped, wide).to_string();
    wide.scope_id(0); // the number of an interface of one host
    return wide.to_string();
}

bool leads_to(const endpoint& dialled, bool same_host, const endpoint& reached, const environment& env) {
    if (dialled.kind != reached.kind) return false;
    if (!dialled.has_port()) return same_host && dialled.path == reached.path;
    auto plain = dialled;
    plain.host = spelled_once(dialled.host);
    auto here = spelled_once(reached.host);
    if (plain.port != reached.port) return false;
    if (within_host(plain) && !same_host) return false; // every host has these
    if (plain.host == here) return true;
    if (here != "0.0.0.0" && here != "::") return false;
    if (within_host(plain)) return true;
    auto all = env.interface_addresses();
    return std::ranges::any_of(all, [&](const auto& one) { return spelled_once(one) == plain.host; });
}

} // namespace

std::optional<failure> objection_to_way(const wire::hello& caller, const endpoint& reached,
                                        const std::vector<endpoint>& advertised, const environment& env) {
    if (caller.dialled.empty() || reached.kind->encrypted || reached.kind->same_process) return {};
    constexpr std::size_t most = 2; // as connected, and as asked for
    auto count = std::min(caller.dialled.size(), most);
    for (std::size_t i = 0; i < count; ++i) {
        auto parsed = endpoint::parse(caller.dialled[i]);
        if (!parsed) continue;
        if (i == 0 && leads_to(*parsed, caller.host_key == env.identity().host_key, reached, env)) return {};
        if (std::ranges::find(advertised, *parsed) != advertised.end()) return {};
    }
    return failure(errc::unauthorized,
                   fmt::format("it was dialled as {}, but this endpoint is {}: a third party relays the session, and "
                               "could impersonate either side. If that is your tunnel or address "
                               "translation, start the component behind it with --advertise {}",
                               caller.dialled.front(), reached.text(), caller.dialled.back()));
}

} // namespace ise::net
