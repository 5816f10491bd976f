#include <components/gui_client/alarm_rules.hpp>

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/track_store.hpp>
#include <components/gui_client/words.hpp>

#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <cmath>

namespace atirma::console {
namespace {

std::string clock_text(utc_time at) { return ise::iso_8601(at).substr(11, 8) + " UTC"; }

void watch_boat(alarm_book& alarms, const alarm_causes& causes, utc_time now) {
    const auto& limits = causes.limits;
    const auto& boat = causes.boat;
    if (boat.last_heard) {
        double period = 0;
        for (const auto& [path, link] : causes.links)
            if (link.link && link.last_heard == boat.last_heard) period = boat.rhythm.position_s(*link.link);
        bool silent = age_s(now, *boat.last_heard) > std::max(limits.no_data_s, 5 * period);
        alarms.set("no_data", silent, severity::critical,
                   fmt::format("Nothing heard from the boat since {}", clock_text(*boat.last_heard)), now);
    }
    auto cause = boat.beacon ? boat.beacon->value.text : std::string("beacon");
    alarms.set(
        "second_controller", boat.on_beacon(), severity::critical,
        boat.on_beacon()
            ? fmt::format("The newest position, of {}, is the second controller's ({}). Nothing newer comes from "
                          "the main one: expect that nobody steers and that no telecommand arrives",
                          clock_text(boat.position->measured_at), cause)
            : std::string(),
        now);
    alarms.set("fix", !boat.has_fix, severity::warning, "The boat has no position fix", now);
    if (boat.supply) {
        const auto& p = boat.supply->value;
        const auto* low = alarms.find("battery");
        bool was_low = low && !low->over_at;
        bool is_low = p.battery_percent < limits.battery_low_percent + (was_low ? 5 : 0); // hysteresis
        bool was_critical = was_low && low->how == severity::critical;
        auto how = p.battery_percent < limits.battery_critical_percent + (was_critical ? 5 : 0) ? severity::critical
                                                                                                : severity::warning;
        alarms.set("battery", is_low, how,
                   fmt::format("The battery is low: {} %, {:.1f} V", p.battery_percent, p.battery_v), now);
        alarms.set("faults", p.faults != 0, severity::warning, fmt::format("The boat reports faults: {:04X}", p.faults),
                   now);
    }
    if (boat.sailing) {
        const auto& n = boat.sailing->value;
        alarms.set("irons", n.in_irons, severity::critical,
                   "In irons: head to wind without speed; the boat does not get out by itself", now);
        alarms.set("beacon", n.beacon, severity::critical, "The emergency beacon is on", now);
        alarms.set("turned_back", n.at_fence, severity::warning,
                   "The boat has turned back at its fence or before the coast, and loiters: give it another course",
                   now);
        alarms.set("remote_control", n.remote_control, severity::notice,
                   "The remote control has the helm: the boat refuses telecommands that steer it", now);
        bool follows =
            (n.mode == sailing_mode::automatic || n.mode == sailing_mode::return_home) && n.waypoint_count > 0;
        const auto* off = alarms.find("off_track");
        bool was_off = off && !off->over_at;
        auto error = static_cast<double>(std::abs(n.cross_track_error_m));
        bool is_off = follows && error > limits.off_track_m * (was_off ? 0.8 : 1.0);
        alarms.set(
            "off_track", is_off, severity::warning,
            fmt::format("Off track: {:.0f} m {} of the leg", error, n.cross_track_error_m > 0 ? "right" : "left"), now);
    }
}

void watch_budget(alarm_book& alarms, const std::string& path, const link_view& link, utc_time now) {
    auto budget = link.budget();
    auto end = end_of_budget(budget, 1, now);
    auto left = [](const std::optional<std::uint64_t>& limit, const std::optional<std::uint64_t>& rest) {
        return limit ? 100 * rest.value_or(0) / *limit : 100;
    };
    std::string text;
    if (end && link.gprs) text = link.gprs->budget_notice;
    else if (end) text = end->text + "; telecommands over it wait";
    else
        text = fmt::format("{} % of today's budget and {} % of this month's are left",
                           left(budget.daily, budget.daily_left), left(budget.monthly, budget.monthly_left));
    alarms.set("budget:" + path, end || is_low(budget), end ? severity::warning : severity::notice,
               fmt::format("{}: {}", label(link), text), now);
}

void watch_links(alarm_book& alarms, const alarm_causes& causes, utc_time now) {
    const auto& limits = causes.limits;
    const auto& boat = causes.boat;
    const auto& finding = causes.finding;
    alarms.set("names", finding.uses_names && !finding.reached && !finding.trouble.empty(), severity::notice,
               fmt::format("The name server at {} is not reached; components found before stay connected ({})",
                           finding.where, finding.trouble),
               now);
    for (const auto& [path, link] : causes.links) {
        if (link.all_links) continue; // the nodes have rules of their own
        auto name = label(link);
        bool lost = !link.connected && link.since != utc_time() && age_s(now, link.since) > limits.proxy_lost_s;
        alarms.set("proxy:" + path, lost, severity::warning, fmt::format("{}: {} is not reached", name, path), now);
        // For a boat that does not call, the rule "silent" is enough; this one is for a boat that calls and a proxy
        // that fails.
        auto trouble = link.xbee                           ? link.xbee->trouble
                       : link.gprs && link.gprs->connected ? link.gprs->trouble
                       : link.account                      ? link.account->trouble
                                                           : std::string();
        alarms.set("port:" + path, link.connected && !trouble.empty(), severity::warning,
                   fmt::format("{}: {}", name, trouble), now);
        watch_budget(alarms, path, link, now);
        bool silent = false;
        if (link.last_heard && link.link) {
            double period = boat.rhythm.position_s(*link.link);
            bool off = boat.settings && static_cast<std::size_t>(*link.link) < link_count &&
                       boat.settings->value.telemetry_period_s[static_cast<std::size_t>(*link.link)] == 0;
            silent = !off && age_s(now, *link.last_heard) > std::max(limits.link_silent_s, 5 * period);
        }
        alarms.set("silent:" + path, silent, severity::warning,
                   fmt::format("{}: the boat has not been heard since {}", name,
                               link.last_heard ? clock_text(*link.last_heard) : ""),
                   now);
        if (!link.xbee) continue;
        alarms.set(
            "hot:" + path, link.xbee->temperature_c.value_or(0) >= limits.modem_hot_c, severity::warning,
            fmt::format("{}: the modem is at {} °C and transmits less", name, link.xbee->temperature_c.value_or(0)),
            now);
        alarms.set("duty:" + path, link.xbee->duty_cycle_percent.value_or(0) >= limits.duty_percent, severity::warning,
                   fmt::format("{}: {} % of the allowed duty cycle is used; at 100 % the modem stops transmitting",
                               name, link.xbee->duty_cycle_percent.value_or(0)),
                   now);
    }
}

void watch_nodes(alarm_book& alarms, const alarm_causes& causes, utc_time now) {
    std::size_t reached = 0;
    for (const auto& [path, node] : causes.nodes) {
        bool lost = !node.connected && age_s(now, *node.told_at) > causes.limits.proxy_lost_s;
        reached += lost ? 0 : 1;
        alarms.set("node:" + path, lost, severity::warning,
                   fmt::format("The communication node {} is not reached", path), now);
        bool sick = node.connected && node.state && !node.state->trouble.empty();
        alarms.set("disk:" + path, sick, severity::warning,
                   fmt::format("{}: {}", path, sick ? node.state->trouble : std::string()), now);
        bool befell = node.connected && node.state && !node.state->store_notice.empty();
        alarms.set("store:" + path, befell, severity::warning,
                   fmt::format("{}: {}", path, befell ? node.state->store_notice : std::string()), now);
    }
    alarms.set("nodes", !causes.nodes.empty() && reached == 0, severity::critical,
               "No communication node is reached: nothing is recorded, and telecommands wait", now);
}

} // namespace

void apply_alarm_rules(alarm_book& alarms, const alarm_causes& causes, utc_time now) {
    watch_boat(alarms, causes, now);
    watch_links(alarms, causes, now);
    watch_nodes(alarms, causes, now);
}

} // namespace atirma::console
