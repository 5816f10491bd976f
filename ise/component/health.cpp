#include <ise/component/health.hpp>

#include <ise/service/publication_core.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>

namespace ise {

health_text health_of(service_host& services) {
    health_text made;
    made.wall = services.env().wall();
    made.incarnation = services.self().incarnation;
    const auto& counts = services.counts();
    made.calls_served = counts.calls_served;
    made.calls_refused = counts.calls_refused;
    made.packets_dropped = counts.packets_dropped;
    for (const auto& one : services.services().describe()) {
        if (!one.provided) continue;
        service_load load;
        load.name = one.name;
        if (auto calls = services.services().find_calls(one.name)) load.running = calls->running();
        if (auto publication = services.services().find_publication(one.name)) {
            load.subscribers = publication->subscribers();
            load.published = publication->published();
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
