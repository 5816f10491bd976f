#include "rates.hpp"

#include <algorithm>
#include <map>

namespace ise::cli {
namespace {

// Bytes of sessions with those who do not only look, in and out.
std::pair<std::uint64_t, std::uint64_t> bytes_of(const component_info& about) {
    std::pair<std::uint64_t, std::uint64_t> sum;
    for (const auto& one : about.sessions) {
        if (peer_of(one.peer).looks_only()) continue;
        sum.first += one.bytes_in;
        sum.second += one.bytes_out;
    }
    return sum;
}

void compare(activity& made, const surveyed& then, const surveyed& now) {
    double seconds = std::chrono::duration<double>(now.answered_at - then.answered_at).count();
    if (seconds <= 0) return;
    auto rate = [&](std::uint64_t to, std::uint64_t from) { return static_cast<double>(grown(to, from)) / seconds; };
    // Our own two questions were calls too.
    auto asked = std::uint64_t{now.health ? 2u : 1u};
    made.calls_hz = rate(grown(now.about->calls_served, asked), then.about->calls_served);
    made.packets_hz = rate(now.about->packets_published, then.about->packets_published);
    auto [in, out] = bytes_of(*now.about);
    auto [in_before, out_before] = bytes_of(*then.about);
    // A session that ended took its bytes along: nobody knows what came over it meanwhile.
    if (in >= in_before && out >= out_before) {
        made.in_bps = rate(in, in_before);
        made.out_bps = rate(out, out_before);
    }
    made.dropped = grown(now.about->packets_dropped, then.about->packets_dropped);
    if (!now.health || !then.health) return;
    made.refused = grown(now.health->calls_refused, then.health->calls_refused);
    made.services = service_activities(*then.health, *now.health, seconds);
}

} // namespace

std::vector<activity> activities(const std::vector<surveyed>& before, const std::vector<surveyed>& now) {
    std::map<std::uint64_t, const surveyed*> lives;
    for (const auto& one : before)
        if (one.about) lives[one.about->incarnation] = &one;
    std::vector<activity> all;
    for (const auto& one : now) {
        activity made;
        made.path = one.name.path;
        made.host = one.name.host_name;
        made.answered = one.about.has_value();
        made.state = one.about && one.name.state != "stalled" ? one.about->state : one.name.state;
        if (one.about) {
            for (const auto& session : one.about->sessions) {
                if (peer_of(session.peer).looks_only()) continue;
                ++made.sessions;
                made.round_trip = std::max(made.round_trip, duration(session.round_trip_ns));
            }
            made.dropped_ever = one.about->packets_dropped;
            if (auto then = lives.find(one.about->incarnation); then != lives.end()) compare(made, *then->second, one);
        }
        if (one.health) {
            made.has_health = true;
            made.refused_ever = one.health->calls_refused;
            for (const auto& service : one.health->services)
                if (!is_own_service(service.name)) made.running += service.running;
            for (const auto& session : one.health->sessions) made.unsent_bytes += session.unsent_bytes;
        }
        all.push_back(std::move(made));
    }
    return all;
}

} // namespace ise::cli
