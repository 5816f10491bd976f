#include <ise/component/health.hpp>

#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>
#include <ise/subscription/publication_core.hpp>

namespace ise {
namespace {

std::vector<duration_count> counts_of(const duration_histogram* from) {
    std::vector<duration_count> made;
    for (std::size_t at = 0; from && at < duration_histogram::buckets; ++at)
        if (from->count(at) > 0)
            made.push_back({static_cast<std::uint64_t>(duration_histogram::end_of(at).count()), from->count(at)});
    return made;
}

std::vector<drop_count> counts_of(const publication_losses& from) {
    std::vector<drop_count> made;
    for (const auto& [reason, count] : {std::pair("replaced", from.replaced),
                                        {"overrun", from.overrun},
                                        {"too_many_bytes", from.too_many_bytes},
                                        {"too_large", from.too_large},
                                        {"ended", from.ended}})
        if (count > 0) made.push_back({reason, count});
    return made;
}

} // namespace

health_report health_of(service_host& services) {
    health_report made;
    made.wall = services.env().wall();
    made.incarnation = services.self().incarnation;
    const auto& counts = services.counts();
    made.calls_served = counts.calls_served;
    made.calls_refused = counts.calls_refused;
    made.packets_dropped = counts.packets_dropped;
    made.calls_expired = counts.calls_expired;
    made.calls_overloaded = counts.calls_overloaded;
    made.cautions = services.cautions();
    for (const auto& one : services.services().describe()) {
        if (!one.provided) continue;
        service_load load;
        load.name = one.name;
        if (auto calls = services.services().find_calls(one.name)) {
            load.running = calls->running();
            load.waiting = calls->waiting();
            const auto& meter = calls->meter();
            load.calls = meter.calls();
            load.overloaded = meter.overloaded();
            load.expired = meter.expired();
            load.waited = counts_of(meter.waiting());
            load.handled = counts_of(meter.handling());
        }
        if (auto publication = services.services().find_publication(one.name)) {
            load.subscribers = publication->subscribers();
            load.published = publication->published();
            load.waiting = publication->queued();
            load.drops = counts_of(publication->losses);
        }
        made.services.push_back(std::move(load));
    }
    for (const auto& [raw, held] : services.sessions()) {
        session_load load;
        load.peer = held->peer_name();
        load.unsent_bytes = held->wire().out().pending_bytes();
        made.sessions.push_back(std::move(load));
    }
    return made;
}

} // namespace ise
