#include <ise/naming/held_name.hpp>

#include <fmt/format.h>

namespace ise {

using naming::verdict;

naming::component_claim held_name::claim() const {
    naming::component_claim made;
    made.path = who.path;
    made.incarnation = who.incarnation;
    made.epoch = epoch;
    made.proof = proof;
    made.type = who.type;
    made.state = who.state;
    made.roles = who.roles;
    made.waits_for = who.waits_for;
    for (const auto& at : who.endpoints) made.endpoints.push_back(at.text());
    for (const auto& service : who.services) {
        naming::service_entry entry;
        entry.name = service.name;
        entry.kind = static_cast<std::uint8_t>(service.kind);
        entry.provided = service.provided;
        if (service.types) entry.fingerprints = service.types->fingerprints;
        made.services.push_back(std::move(entry));
    }
    return made;
}

result<void> held_name::take(const naming::grant& answer, time_point now, duration lease, std::uint64_t server) {
    switch (answer.what) {
        case verdict::granted:
            epoch = answer.epoch;
            proof = answer.proof;
            other.reset();
            obstacle.clear();
            return {};
        case verdict::wait:
            not_before = saturating_add(now, answer.retry_after);
            obstacle = answer.reason;
            return {};
        case verdict::taken: {
            auto holder = answer.held_by.empty() ? naming::holder() : answer.held_by.front();
            // Each server counts them by itself, and one that was restarted anew.
            if (!other || other_at != server || other->epoch != holder.epoch || holder.renewals < other->renewals) {
                other = holder;
                other_at = server;
            }
            if (holder.renewals >= other->renewals + 2) return failure(errc::name_taken, answer.reason);
            not_before = saturating_add(now, lease / 5);
            obstacle = answer.reason;
            return {};
        }
        case verdict::superseded:
            return failure(errc::superseded, fmt::format("another took this name over: {}", answer.reason));
        case verdict::refused:
            return failure(errc::refused, fmt::format("the name server refuses '{}': {}", who.path, answer.reason));
    }
    return failure(errc::protocol_error,
                   fmt::format("the name server gives '{}' an answer of a later version", who.path));
}

} // namespace ise
