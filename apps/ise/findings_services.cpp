#include "findings.hpp"

#include "text.hpp"

#include <ise/component/discover.hpp>
#include <ise/packet/compatibility.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace ise::cli {
namespace {

const service_text* provided_by(const surveyed& one, const service_text& wanted) {
    if (!one.about) return nullptr;
    for (const auto& service : one.about->services)
        if (service.provided && service.name == wanted.name && service.kind == wanted.kind) return &service;
    return nullptr;
}

bool talk(const surveyed& a, const surveyed& b) {
    auto sees = [](const surveyed& one, const surveyed& other) {
        return one.about && std::ranges::any_of(one.about->sessions, [&](const auto& session) {
                   return peer_of(session.peer).path == other.name.path;
               });
    };
    return sees(a, b) || sees(b, a);
}

// Who reads a packet: requests are read by the provider, everything else by who requires the service.
bool read_by_provider(service_kind kind, std::size_t place) {
    return kind == service_kind::request_response
               ? place == role::request
               : place == role::subscribe_request || place == role::unsubscribe_request;
}

void examine_one(const surveyed& needs, const service_text& wanted, const std::vector<surveyed>& all,
                 std::vector<finding>& found) {
    struct candidate {
        const surveyed* who;
        std::string why;
    };
    std::vector<candidate> misfits;
    std::vector<std::string> there;
    bool fits = false, unknown = false;
    for (const auto& one : all) {
        if (!one.about) unknown = true;
        if (&one == &needs) continue;
        const auto* provided = provided_by(one, wanted);
        if (!provided) continue;
        there.push_back(one.name.path);
        auto why = misfit(wanted, *provided);
        if (why.empty()) fits = true;
        else misfits.push_back({&one, std::move(why)});
    }
    const auto& path = needs.name.path;
    for (auto& one : misfits) {
        bool connected = talk(needs, *one.who);
        // Others may use the same name for something else: it matters between connected components, or if there is no
        // other provider.
        if (!connected && (fits || misfits.size() > 1)) continue;
        found.push_back({connected ? severity::error : severity::warning, "schema_mismatch", path,
                         fmt::format("'{}' as it needs it does not fit '{}' of {}:\n{}", wanted.name, wanted.name,
                                     one.who->name.path, one.why),
                         fmt::format("build both from the same header; what may change is in LAYOUT.md (fields are "
                                     "only appended). Compare: ise type diff {} {} {}",
                                     path, wanted.name, one.who->name.path)});
    }
    if (wanted.declared && there.empty() && !unknown) // undeclared ones are reported as waits
        found.push_back(
            {severity::warning, "no_provider", path,
             fmt::format("no component provides '{}', which it requires", wanted.name),
             "start the component that provides it (ise start --types), or does another name server know it?"});
}

} // namespace

std::string misfit(const service_text& required, const service_text& provided) {
    auto mine = contract_of(required), theirs = contract_of(provided);
    if (!mine) return fmt::format("  it is not described readably: {}\n", mine.error().message());
    if (!theirs) return fmt::format("  it is not described readably: {}\n", theirs.error().message());
    std::string text;
    for (std::size_t place = 0; place < required.packets.size() && place < provided.packets.size(); ++place) {
        const auto& here = mine->packet(place);
        const auto& there = theirs->packet(place);
        auto why = read_by_provider(mine->kind(), place) ? incompatibility(there, here) : incompatibility(here, there);
        if (!why) continue;
        auto from = std::size_t{0};
        text += fmt::format("  {}\n", role::name(mine->kind(), place));
        while (from < why->size()) {
            auto to = std::min(why->find('\n', from), why->size());
            text += fmt::format("    {}\n", why->substr(from, to - from));
            from = to + 1;
        }
    }
    return text;
}

std::vector<finding> examine_services(const std::vector<surveyed>& now) {
    std::vector<finding> found;
    for (const auto& one : now) {
        if (!one.about) continue;
        for (const auto& service : one.about->services)
            if (!service.provided && !is_own_service(service.name)) examine_one(one, service, now, found);
    }
    return found;
}

} // namespace ise::cli
