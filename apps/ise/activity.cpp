#include "activity.hpp"

#include <algorithm>
#include <cmath>
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
        made.in_bytes_per_s = rate(in, in_before);
        made.out_bytes_per_s = rate(out, out_before);
    }
    made.dropped_too_slow_now = grown(now.about->packets_dropped, then.about->packets_dropped);
    if (!now.health || !then.health) return;
    made.calls_refused_now = grown(now.health->calls_refused, then.health->calls_refused);
    made.services = service_activities(*then.health, *now.health, seconds);
}

json_object<loss_count> losses_of(const service_load& before, const service_load& now) {
    json_object<loss_count> made;
    auto add = [&](const std::string& reason, std::uint64_t ever, std::uint64_t then) {
        if (ever > 0) made.emplace_back(reason, loss_count{ever, grown(ever, then)});
    };
    add("overloaded", now.overloaded, before.overloaded);
    add("expired", now.expired, before.expired);
    for (const auto& one : now.drops) {
        auto then = std::ranges::find(before.drops, one.reason, &drop_count::reason);
        add(one.reason, one.count, then == before.drops.end() ? 0 : then->count);
    }
    return made;
}

} // namespace

std::uint64_t grown(std::uint64_t now, std::uint64_t before) { return now - std::min(now, before); }

bool service_activity::loses() const noexcept {
    return std::ranges::any_of(losses, [](const auto& one) { return one.second.now > 0; });
}

std::variant<service_activity::answered, service_activity::published> service_activity::json() const {
    if (publishes)
        return published{.name = name, .hz = hz, .waiting = waiting, .subscribers = subscribers, .not_sent = losses};
    return answered{.name = name,
                    .hz = hz,
                    .waiting = waiting,
                    .running = running,
                    .handled_p50_s = handled_p50,
                    .handled_p99_s = handled_p99,
                    .waited_p50_s = waited_p50,
                    .waited_p99_s = waited_p99,
                    .refused = losses};
}

std::optional<duration> percentile(const std::vector<duration_count>& before, const std::vector<duration_count>& now,
                                   double part) {
    std::map<std::uint64_t, std::uint64_t> counts;
    for (const auto& one : now) counts[one.below_ns] += one.count;
    for (const auto& one : before) {
        auto& count = counts[one.below_ns];
        count = grown(count, one.count);
    }
    std::uint64_t all = 0;
    for (const auto& [below, count] : counts) all += count;
    if (all == 0) return std::nullopt;
    auto wanted = std::max<std::uint64_t>(static_cast<std::uint64_t>(std::ceil(part * static_cast<double>(all))), 1);
    for (const auto& [below, count] : counts) {
        if (count >= wanted)
            return duration(static_cast<std::int64_t>(std::min<std::uint64_t>(below, std::uint64_t{1} << 62)));
        wanted -= count;
    }
    return std::nullopt;
}

std::vector<service_activity> service_activities(const health_report& before, const health_report& now,
                                                 double seconds) {
    std::vector<service_activity> all;
    if (seconds <= 0) return all;
    for (const auto& one : now.services) {
        auto then = std::ranges::find(before.services, one.name, &service_load::name);
        if (is_own_service(one.name) || then == before.services.end()) continue;
        service_activity made;
        made.name = one.name;
        made.publishes = one.published > 0 || one.subscribers > 0;
        made.hz = static_cast<double>(made.publishes ? grown(one.published, then->published)
                                                     : grown(one.calls, then->calls)) /
                  seconds;
        made.running = one.running;
        made.waiting = one.waiting;
        made.subscribers = one.subscribers;
        made.handled_p50 = percentile(then->handled, one.handled, 0.5);
        made.handled_p99 = percentile(then->handled, one.handled, 0.99);
        made.waited_p50 = percentile(then->waited, one.waited, 0.5);
        made.waited_p99 = percentile(then->waited, one.waited, 0.99);
        made.losses = losses_of(*then, one);
        all.push_back(std::move(made));
    }
    return all;
}

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
                if (session.round_trip_ns > 0)
                    made.round_trip_s =
                        std::max(made.round_trip_s.value_or(duration{}), duration(session.round_trip_ns));
            }
            made.dropped_too_slow = one.about->packets_dropped;
            if (auto then = lives.find(one.about->incarnation); then != lives.end()) compare(made, *then->second, one);
        }
        if (one.health) {
            made.running = made.unsent_bytes = 0;
            made.calls_refused = one.health->calls_refused;
            for (const auto& service : one.health->services)
                if (!is_own_service(service.name)) *made.running += service.running;
            for (const auto& session : one.health->sessions) *made.unsent_bytes += session.unsent_bytes;
        }
        all.push_back(std::move(made));
    }
    return all;
}

} // namespace ise::cli
