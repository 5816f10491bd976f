#include <components/gui_client/console_state.hpp>

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <fmt/format.h>

#include <cmath>

// When the operator is called: the rules of console_state.
namespace atirma::console {
namespace {

std::string clock_text(utc_time at) { return iso_time(at).substr(11, 8) + " UTC"; }

} // namespace

void console_state::watch_boat(utc_time now) {
    const auto& limits = options_.limits;
    if (boat_.last_heard) {
        double period = 0;
        for (const auto& [path, link] : links_)
            if (link.link && link.last_heard == boat_.last_heard)
                period = expected_period_s(value_kind::position, *link.link, boat_.settings);
        bool silent = age_s(now, *boat_.last_heard) > std::max(limits.no_data_s, 5 * period);
        alarms_.set("no_data", silent, severity::critical,
                    fmt::format("Nothing heard from the boat since {}", clock_text(*boat_.last_heard)), now);
    }
    alarms_.set("fix", !boat_.has_fix, severity::warning, "The boat has no position fix", now);
    if (boat_.supply) {
        const auto& p = boat_.supply->value;
        const auto* low = alarms_.find("battery");
        bool was_low = low && !low->over_at;
        bool is_low = p.battery_percent < limits.battery_low_percent + (was_low ? 5 : 0); // no to and fro at the limit
        auto how = p.battery_percent < limits.battery_critical_percent ? severity::critical : severity::warning;
        alarms_.set("battery", is_low, how,
                    fmt::format("The battery is low: {} %, {:.1f} V", p.battery_percent, p.battery_v), now);
        alarms_.set("faults", p.faults != 0, severity::warning,
                    fmt::format("The boat reports faults: {:04X}", p.faults), now);
    }
    if (boat_.sailing) {
        const auto& n = boat_.sailing->value;
        alarms_.set("irons", n.in_irons, severity::critical,
                    "In irons: head to wind without way; it does not get out by itself", now);
        alarms_.set("beacon", n.beacon, severity::critical, "The emergency beacon is on", now);
        alarms_.set("remote_control", n.remote_control, severity::notice, "The remote control has the helm", now);
        bool follows =
            (n.mode == sailing_mode::automatic || n.mode == sailing_mode::return_home) && n.waypoint_count > 0;
        const auto* off = alarms_.find("off_track");
        bool was_off = off && !off->over_at;
        auto error = static_cast<double>(std::abs(n.cross_track_error_m));
        bool is_off = follows && error > limits.off_track_m * (was_off ? 0.8 : 1.0);
        alarms_.set(
            "off_track", is_off, severity::warning,
            fmt::format("Off track: {:.0f} m {} of the leg", error, n.cross_track_error_m > 0 ? "right" : "left"), now);
    }
}

void console_state::watch_links(utc_time now) {
    const auto& limits = options_.limits;
    alarms_.set(
        "names", finding_.uses_names && !finding_.reached && !finding_.trouble.empty(), severity::notice,
        fmt::format("The name server at {} is not reached; components found before stay connected", finding_.where),
        now);
    for (const auto& [path, link] : links_) {
        if (link.all_links) continue; // the nodes tell of themselves
        auto name = label(link);
        bool lost = !link.connected && link.since != utc_time() && age_s(now, link.since) > limits.proxy_lost_s;
        alarms_.set("proxy:" + path, lost, severity::warning, fmt::format("{}: {} is not reached", name, path), now);
        // A boat that does not call is told by its silence; one that calls and is not kept is told here.
        auto trouble = link.xbee                           ? link.xbee->trouble
                       : link.gprs && link.gprs->connected ? link.gprs->trouble
                       : link.account                      ? link.account->trouble
                                                           : std::string();
        alarms_.set("port:" + path, link.connected && !trouble.empty(), severity::warning,
                    fmt::format("{}: {}", name, trouble), now);
        bool silent = false;
        if (link.last_heard && link.link) {
            double period = expected_period_s(value_kind::position, *link.link, boat_.settings);
            bool off = boat_.settings && static_cast<std::size_t>(*link.link) < link_count &&
                       boat_.settings->value.telemetry_period_s[static_cast<std::size_t>(*link.link)] == 0;
            silent = !off && age_s(now, *link.last_heard) > std::max(limits.link_silent_s, 5 * period);
        }
        alarms_.set("silent:" + path, silent, severity::warning,
                    fmt::format("{}: the boat is not heard since {}", name,
                                link.last_heard ? clock_text(*link.last_heard) : ""),
                    now);
        if (!link.xbee) continue;
        alarms_.set("hot:" + path, link.xbee->temperature_c.value_or(0) >= limits.modem_hot_c, severity::warning,
                    fmt::format("{}: the modem is at {} °C and holds back", name, link.xbee->temperature_c.value_or(0)),
                    now);
        alarms_.set("duty:" + path, link.xbee->duty_cycle_percent.value_or(0) >= limits.duty_percent, severity::warning,
                    fmt::format("{}: {} % of the allowed duty cycle is used; at 100 % it falls silent", name,
                                link.xbee->duty_cycle_percent.value_or(0)),
                    now);
    }
}

void console_state::watch_nodes(utc_time now) {
    std::size_t reached = 0;
    for (const auto& [path, node] : nodes_) {
        bool lost = !node.connected && age_s(now, *node.told_at) > options_.limits.proxy_lost_s;
        reached += lost ? 0 : 1;
        alarms_.set("node:" + path, lost, severity::warning,
                    fmt::format("The communication node {} is not reached", path), now);
        bool sick = node.connected && node.state && !node.state->trouble.empty();
        alarms_.set("disk:" + path, sick, severity::warning,
                    fmt::format("{}: {}", path, sick ? node.state->trouble : std::string()), now);
        bool befell = node.connected && node.state && !node.state->store_notice.empty();
        alarms_.set("store:" + path, befell, severity::warning,
                    fmt::format("{}: {}", path, befell ? node.state->store_notice : std::string()), now);
    }
    alarms_.set("nodes", !nodes_.empty() && reached == 0, severity::critical,
                "No communication node is reached: nothing is recorded, and commands wait", now);
}

} // namespace atirma::console
