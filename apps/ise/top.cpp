#include "look.hpp"

#include "connections.hpp"
#include "rates.hpp"
#include "screen.hpp"
#include "survey.hpp"
#include "table.hpp"
#include "text.hpp"
#include "top_services.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <string_view>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t max_rows = 10; // of services: the busiest; of connections: the slowest

std::string show_rate(const std::optional<double>& hz) { return hz ? fmt::format("{:.1f}", *hz) : "-"; }
std::string show_bytes_rate(const std::optional<double>& bps) {
    return bps ? show_bytes(static_cast<std::uint64_t>(*bps)) : "-";
}
// "12 +3": ever, and of these meanwhile.
std::string show_count(std::uint64_t ever, const std::optional<std::uint64_t>& meanwhile) {
    return meanwhile.value_or(0) == 0 ? std::to_string(ever) : fmt::format("{} +{}", ever, *meanwhile);
}

std::string as_table(const std::vector<activity>& all, std::size_t width) {
    table rows({"STATE", "SESSIONS", "CALLS/S", "PACKETS/S", "IN/S", "OUT/S", "RUNNING", "UNSENT", "TOO SLOW",
                "REFUSED", "ROUND TRIP", "PATH"});
    for (const auto& one : all) {
        if (!one.answered) {
            rows.add({one.state == "stalled" ? "stalled" : "no answer", "-", "-", "-", "-", "-", "-", "-", "-", "-",
                      "-", one.path});
            continue;
        }
        rows.add({one.state, std::to_string(one.sessions), show_rate(one.calls_hz), show_rate(one.packets_hz),
                  show_bytes_rate(one.in_bps), show_bytes_rate(one.out_bps),
                  one.has_health ? std::to_string(one.running) : "-",
                  one.has_health ? show_bytes(one.unsent_bytes) : "-", show_count(one.dropped_ever, one.dropped),
                  one.has_health ? show_count(one.refused_ever, one.refused) : "-",
                  one.round_trip > duration{} ? show_duration(one.round_trip) : "-", one.path});
    }
    return rows.text(width, {}, {"SESSIONS", "UNSENT", "RUNNING", "ROUND TRIP", "IN/S", "OUT/S"});
}

// The slowest first.
std::string connections_table(std::vector<connection_line> lines, std::size_t width, std::size_t most) {
    if (lines.empty() || most == 0) return {};
    std::ranges::stable_sort(lines, std::greater(), &connection_line::round_trip);
    table rows({"ROUND TRIP", "OVER", "SENT", "SENT BACK", "CONNECTION"});
    for (std::size_t at = 0; at < std::min(lines.size(), most); ++at) {
        const auto& one = lines[at];
        rows.add(
            {one.round_trip > duration{} ? show_duration(one.round_trip) : "-", one.over, show_bytes(one.bytes_to_b),
             show_bytes(one.bytes_to_a),
             fmt::format("{} -> {}{}", one.a, one.b.empty() ? one.address : one.b, one.stalled ? " (stalled)" : "")});
    }
    return fmt::format("\n{}", rows.text(width, {}, {"SENT BACK", "SENT"}));
}

std::string as_json(const std::vector<activity>& all, const std::vector<connection_line>& lines, wall_time at) {
    auto seconds = [](duration length) {
        return length > duration{} ? ordered_json(std::chrono::duration<double>(length).count()) : ordered_json();
    };
    auto number = [](const auto& value) { return value ? ordered_json(*value) : ordered_json(); };
    ordered_json told;
    told["asked_at"] = show_wall(at);
    auto components = ordered_json::array();
    for (const auto& one : all) {
        ordered_json row;
        row["path"] = one.path;
        row["state"] = one.state;
        row["host"] = one.host;
        row["answered"] = one.answered;
        row["sessions"] = one.sessions;
        row["calls_hz"] = number(one.calls_hz);
        row["packets_hz"] = number(one.packets_hz);
        row["in_bytes_per_s"] = number(one.in_bps);
        row["out_bytes_per_s"] = number(one.out_bps);
        row["running"] = one.has_health ? ordered_json(one.running) : ordered_json();
        row["unsent_bytes"] = one.has_health ? ordered_json(one.unsent_bytes) : ordered_json();
        row["dropped_too_slow"] = one.dropped_ever;
        row["dropped_too_slow_now"] = number(one.dropped);
        row["calls_refused"] = one.has_health ? ordered_json(one.refused_ever) : ordered_json();
        row["calls_refused_now"] = number(one.refused);
        row["round_trip_s"] = seconds(one.round_trip);
        row["services"] = services_json(one);
        components.push_back(std::move(row));
    }
    told["components"] = std::move(components);
    auto connections = ordered_json::array();
    for (const auto& one : lines) {
        ordered_json row;
        row["a"] = one.a;
        row["b"] = one.b.empty() ? ordered_json() : ordered_json(one.b);
        row["address"] = one.address;
        row["over"] = one.over;
        row["round_trip_s"] = seconds(one.round_trip);
        row["bytes_to_a"] = one.bytes_to_a;
        row["bytes_to_b"] = one.bytes_to_b;
        connections.push_back(std::move(row));
    }
    told["connections"] = std::move(connections);
    return told.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

std::size_t lines_of(std::string_view text) { return static_cast<std::size_t>(std::ranges::count(text, '\n')); }

// All components, and of services and connections as many as there is room for in `height` lines; 0: any number.
std::string as_page(const std::vector<activity>& seen, const std::vector<connection_line>& lines,
                    const std::string& ending, std::size_t width, std::size_t height) {
    auto components = as_table(seen, width);
    std::string below;
    for (auto most = max_rows; most > 0; --most) {
        below = services_table(seen, width, most) + connections_table(lines, width, most);
        if (height == 0 || lines_of(components) + lines_of(below) + lines_of(ending) < height)
            return components + below + ending;
    }
    // The last line stays free: an end of line there would scroll.
    auto room = height > lines_of(ending) + 2 ? height - lines_of(ending) - 2 : 0;
    if (lines_of(components) <= room + 1) return components + ending;
    std::size_t end = 0;
    for (std::size_t shown = 0; shown < room; ++shown) end = components.find('\n', end) + 1;
    return fmt::format("{}{} more components: a taller terminal, or `ise top PREFIX`, shows them\n{}",
                       components.substr(0, end), lines_of(components) - room, ending);
}

// Until then, or a key; false: it is to end.
task<bool> wait_for(context& in, const screen& on, time_point at) {
    constexpr duration look = std::chrono::milliseconds(50);
    while (in.self.now() < at) {
        if (on.quit()) co_return false;
        auto next = on.live() ? std::min(at, in.self.now() + look) : at;
        co_await in.self.sleep_till(next);
    }
    co_return !on.quit();
}

} // namespace

task<> top(context& in, top_options options) {
    survey_options what;
    what.prefix = options.prefix;
    auto before = co_await survey(in, what);
    screen on;
    auto at = in.self.now();
    for (std::uint64_t tables = 0; !options.count || tables < *options.count; ++tables) {
        at = std::max(saturating_add(at, options.every), in.self.now());
        bool goes_on = co_await wait_for(in, on, at);
        if (!goes_on) break;
        in.until = saturating_add(in.self.now(), in.set.timeout);
        auto now = co_await survey(in, what);
        auto seen = activities(before, now);
        std::string text;
        if (in.set.json) {
            text = as_json(seen, connections_of(now), in.self.wall());
        } else {
            auto ending = on.live() ? "TOO SLOW: packets that slow subscribers did not take, ever and now; q ends\n"
                          : tables + 1 == options.count ? ""
                                                        : "\n";
            text = on.page(as_page(seen, connections_of(now), show_age(in, now) + ending, in.out.width(), on.height()),
                           in.out.width());
        }
        co_await in.out.write(in.self, std::move(text));
        before = std::move(now);
    }
}

} // namespace ise::cli
