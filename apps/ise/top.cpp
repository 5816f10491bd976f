// ise top: what every component does, again and again.
#include "activity.hpp"
#include "connections.hpp"
#include "json.hpp"
#include "metering.hpp"
#include "styled.hpp"
#include "survey.hpp"
#include "table.hpp"
#include "terminal.hpp"
#include "text.hpp"
#include "top_live.hpp"

#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <string_view>
#include <utility>

namespace ise::cli {
namespace {

struct top_options {
    std::string prefix;
    duration every = std::chrono::seconds(1);
    std::optional<std::uint64_t> count; ///< tables until it ends
    bool once = false;
};

struct top_connection {
    std::string a;
    std::optional<std::string> b;
    std::string address, over;
    std::optional<duration> round_trip_s;
    std::uint64_t bytes_to_a = 0, bytes_to_b = 0;
};
struct top_table {
    std::string asked_at;
    std::vector<activity> components;
    std::vector<top_connection> connections;
};

constexpr std::size_t max_rows = 10; // of services: the busiest; of connections: the slowest

std::string show_rate(const std::optional<double>& hz) { return hz ? fmt::format("{:.1f}", *hz) : "-"; }
std::string show_bytes_rate(const std::optional<double>& bps) {
    return bps ? show_bytes(static_cast<std::uint64_t>(*bps)) : "-";
}
// "12 +3": ever, and of these meanwhile.
std::string show_count(std::uint64_t ever, const std::optional<std::uint64_t>& meanwhile) {
    return meanwhile.value_or(0) == 0 ? std::to_string(ever) : fmt::format("{} +{}", ever, *meanwhile);
}

std::string activity_table(const std::vector<activity>& all, std::size_t width) {
    table rows({"STATE", "SESSIONS", "CALLS/S", "PACKETS/S", "IN/S", "OUT/S", "RUNNING", "UNSENT", "TOO SLOW",
                "REFUSED", "ROUND TRIP", "PATH"});
    for (const auto& one : all) {
        if (!one.answered) {
            rows.add({one.state == "stalled" ? "stalled" : "no answer", "-", "-", "-", "-", "-", "-", "-", "-", "-",
                      "-", one.path});
            continue;
        }
        rows.add({one.state, std::to_string(one.sessions), show_rate(one.calls_hz), show_rate(one.packets_hz),
                  show_bytes_rate(one.in_bytes_per_s), show_bytes_rate(one.out_bytes_per_s),
                  one.running ? std::to_string(*one.running) : "-",
                  one.unsent_bytes ? show_bytes(*one.unsent_bytes) : "-",
                  show_count(one.dropped_too_slow, one.dropped_too_slow_now),
                  one.calls_refused ? show_count(*one.calls_refused, one.calls_refused_now) : "-",
                  one.round_trip_s ? show_duration(*one.round_trip_s) : "-", one.path});
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

using busy_row = std::pair<const activity*, const service_activity*>;

// Nearly every call finds a handler at once: "0" reads better than the first bucket's end.
std::string show_wait(const std::optional<duration>& wait) {
    if (!wait) return "-";
    return *wait <= std::chrono::microseconds(2) ? "0" : show_duration(*wait);
}
std::string show_took(const std::optional<duration>& took) { return took ? show_duration(*took) : "-"; }

std::string show_service_losses(const service_activity& of) {
    std::string text;
    for (const auto& [reason, count] : of.losses)
        text += fmt::format("{}{} {}{}", text.empty() ? "" : ", ", count.ever,
                            count.now > 0 ? fmt::format("+{} ", count.now) : "", reason);
    return text.empty() ? "-" : text;
}

std::vector<busy_row> busiest(const std::vector<activity>& all, bool publish, std::size_t most) {
    std::vector<busy_row> rows;
    for (const auto& one : all)
        for (const auto& service : one.services)
            if (service.publishes == publish && service.at_work()) rows.emplace_back(&one, &service);
    auto urgent = [](const busy_row& of) { return std::tuple(of.second->loses(), of.second->waiting, of.second->hz); };
    std::ranges::stable_sort(rows, [&](const busy_row& a, const busy_row& b) { return urgent(a) > urgent(b); });
    rows.resize(std::min(rows.size(), most));
    return rows;
}

// The services and publications at work: those that lose something first, then by what waits and how busy they are,
// `most` of each kind. Empty where none is.
std::string services_table(const std::vector<activity>& all, std::size_t width, std::size_t most) {
    std::string text;
    if (auto rows = busiest(all, false, most); !rows.empty()) {
        table calls({"CALLS/S", "P50", "P99", "WAIT P50", "WAIT P99", "RUNNING", "WAITING", "REFUSED", "SERVICE"});
        for (const auto& [of, one] : rows)
            calls.add({fmt::format("{:.1f}", one->hz), show_took(one->handled_p50), show_took(one->handled_p99),
                       show_wait(one->waited_p50), show_wait(one->waited_p99), std::to_string(one->running),
                       std::to_string(one->waiting), show_service_losses(*one),
                       fmt::format("{} {}", of->path, one->name)});
        text += fmt::format("\n{}", calls.text(width, {}, {"WAIT P50", "P50", "RUNNING", "WAITING", "WAIT P99"}));
    }
    if (auto rows = busiest(all, true, most); !rows.empty()) {
        table packets({"PACKETS/S", "SUBSCRIBERS", "WAITING", "NOT SENT", "PUBLICATION"});
        for (const auto& [of, one] : rows)
            packets.add({fmt::format("{:.1f}", one->hz), std::to_string(one->subscribers), std::to_string(one->waiting),
                         show_service_losses(*one), fmt::format("{} {}", of->path, one->name)});
        text += fmt::format("\n{}", packets.text(width, {}, {"WAITING", "SUBSCRIBERS"}));
    }
    return text;
}

top_table top_of(std::vector<activity> all, const std::vector<connection_line>& lines, wall_time at) {
    top_table made{iso_8601(at), std::move(all), {}};
    for (const auto& one : lines) {
        top_connection row{one.a, {}, one.address, one.over, {}, one.bytes_to_a, one.bytes_to_b};
        if (!one.b.empty()) row.b = one.b;
        if (one.round_trip > duration{}) row.round_trip_s = one.round_trip;
        made.connections.push_back(std::move(row));
    }
    return made;
}

class activity_pages final : public window_printer {
public:
    activity_pages(context& in, survey_options what, std::vector<surveyed> first)
        : in_(in), what_(std::move(what)), before_(std::move(first)) {}

    task<std::string> take(duration, bool last) override {
        in_.until = saturating_add(in_.self.now(), in_.set.timeout);
        auto now = co_await survey(in_, what_);
        auto seen = activities(before_, now);
        auto lines = connections_of(now);
        auto age = show_age(in_, now);
        before_ = std::move(now);
        if (in_.set.json) co_return json_line(top_of(std::move(seen), lines, in_.self.wall()));
        auto width = in_.out.width();
        co_return activity_table(seen, width) + services_table(seen, width, max_rows) +
            connections_table(lines, width, max_rows) + age + (last ? "" : "\n");
    }

private:
    context& in_;
    survey_options what_;
    std::vector<surveyed> before_;
};

// Nothing: tables are to be printed.
std::unique_ptr<terminal> terminal_for(context& in, const top_options& options) {
    // Lines of the log would be written over the page.
    if (options.count || in.set.json || in.set.verbose || !terminal::available()) return nullptr;
    std::string why;
    auto taken = terminal::open(has_colours(in.self.env()), why);
    if (!taken) note(in.set, why);
    return taken;
}

task<> top(context& in, top_options options) {
    survey_options what;
    what.prefix = options.prefix;
    auto first = co_await survey(in, what);
    if (auto on = terminal_for(in, options)) {
        auto showing = top_live(in, std::move(what), options.every, std::move(first), std::move(on));
        co_return co_await std::move(showing);
    }
    activity_pages pages(in, std::move(what), std::move(first));
    co_await print_windows(in, options.every, options.count, pages);
}

void declare_top(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<top_options>();
    add_prefix(app, given->prefix);
    add_time(app, "--every", given->every, "time between two looks (default: 1s)");
    auto* once = app.add_flag("--once", given->once, "one set of tables, after that time");
    add_count(app, given->count, "print tables N times")->excludes(once);
    app.callback([&made, given] {
        check_prefix(given->prefix);
        if (given->once) given->count = 1;
        made.looks = true;
        made.endless = !given->count;
        made.work = [given](context& in) { return top(in, *given); };
    });
}

} // namespace

extern const command top_command{"top", measure_group, "shows the activity of every component; ? for help, q ends",
                                 "  ise top\n  ise top atirma --once\n", declare_top};

} // namespace ise::cli
