#include "service_activity.hpp"

#include "surveyed.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace ise::cli {
std::uint64_t grown(std::uint64_t now, std::uint64_t before) { return now - std::min(now, before); }

namespace {

std::vector<service_activity::loss> losses_of(const service_load& before, const service_load& now) {
    std::vector<service_activity::loss> made;
    auto add = [&](const std::string& reason, std::uint64_t ever, std::uint64_t then) {
        if (ever > 0) made.push_back({reason, ever, grown(ever, then)});
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

bool service_activity::loses() const noexcept {
    return std::ranges::any_of(losses, [](const loss& one) { return one.meanwhile > 0; });
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

} // namespace ise::cli
