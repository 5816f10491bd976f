#include "plan.hpp"

#include <components/boat/mission_checksum.hpp>
#include <components/boat_simulator/course.hpp>

#include <ise/sim/random.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;
using ise::sim::generator;

ise::duration part_of(ise::duration whole, double part) {
    return std::chrono::floor<std::chrono::milliseconds>(
        ise::duration(static_cast<ise::duration::rep>(static_cast<double>(whole.count()) * part)));
}
double between(generator& dice, double low, double high) {
    return low + (high - low) * static_cast<double>(dice.below(1'000'000)) * 1e-6;
}

template <class T>
void shuffle(generator& dice, std::vector<T>& what) {
    for (std::size_t left = what.size(); left > 1; --left) std::swap(what[left - 1], what[dice.below(left)]);
}

/// One of `kinds` in each slot, all of them in turn, in an order of the dice; each is over well before the slot is.
void fill(voyage_plan& made, generator& dice, std::vector<trouble> kinds, std::size_t slots, ise::duration longest) {
    const auto first = part_of(made.length, 0.05), all = part_of(made.length, 0.90);
    const auto slot = all / static_cast<ise::duration::rep>(slots);
    std::vector<trouble> turn;
    for (std::size_t i = 0; i < slots; ++i) {
        if (turn.empty()) {
            turn = kinds;
            shuffle(dice, turn);
        }
        fault one;
        one.what = turn.back();
        turn.pop_back();
        one.at = first + slot * static_cast<ise::duration::rep>(i) + part_of(slot, between(dice, 0, 0.3));
        one.length = std::min(part_of(slot, between(dice, 0.12, 0.4)), longest);
        using enum trouble;
        if (one.what == carrier_drops || one.what == carrier_half_open || one.what == carrier_moves) one.length = {};
        if (one.what == boat_killed) one.length = std::min<ise::duration>(one.length, 1min); // it starts by itself
        made.faults.push_back(one);
    }
}

/// What everybody may ask.
boat_command question(generator& dice) {
    switch (dice.below(4)) {
        case 0: return commands::ping();
        case 1: return commands::waypoint_read_back();
        case 2: return commands::request_status();
        default: return commands::get_parameter{static_cast<parameter_id>(dice.below(parameter_count))};
    }
}

/// Telecommands that need the authority over the boat.
std::vector<boat_command> steering(generator& dice) {
    using commands::set_mode, commands::set_parameter;
    switch (dice.below(4)) {
        case 0: return {set_mode{sailing_mode::hold}, set_mode{sailing_mode::automatic}};
        case 1: return {set_mode{sailing_mode::station_keep}, set_mode{sailing_mode::automatic}};
        case 2: return {set_parameter{parameter_id::leeway_compensation, static_cast<float>(dice.below(5)) * 0.25f}};
        default: return {set_parameter{parameter_id::time_to_next_tack, static_cast<float>(60 + 30 * dice.below(8))}};
    }
}

void give_orders(voyage_plan& made, generator& dice) {
    const auto away = std::find_if(made.faults.begin(), made.faults.end(),
                                   [](const fault& one) { return one.what == trouble::operator_away; });
    const auto change = part_of(made.length, 0.47);
    for (std::size_t by = 0; by < operators; ++by) {
        const ise::duration shortest = made.length < 15min ? 4s : 20s;
        const auto pause = std::max(part_of(made.length, by == 0 ? 0.012 : 0.02), shortest);
        for (auto at = part_of(made.length, 0.01) + pause; at < part_of(made.length, 0.94);
             at += part_of(pause, between(dice, 0.6, 1.4))) {
            order one;
            one.at = at;
            one.by = by;
            bool only_one = away != made.faults.end() && at > away->at + 10s && at < away->at + away->length;
            if (only_one && by == 0) continue;
            bool steers = by == 0 || only_one;
            one.steps = steers && dice.chance(0.5) ? steering(dice) : std::vector{question(dice)};
            if (std::abs((at - change).count()) < part_of(made.length, 0.03).count() && steers)
                one.steps = {question(dice)}; // not while the course is changed
            auto way = dice.below(100);
            if (way < 15) one.via = link_id::gprs;
            else if (way < 25) one.via = link_id::xbee;
            else if (way < 30) one.via = link_id::iridium;
            one.valid_s = one.via == link_id::iridium ? 7200.0f : 900.0f;
            one.by_console = !one.via && !traits_of(one.steps.front().kind()).needs_authority;
            made.orders.push_back(std::move(one));
        }
    }
    order other_course;
    other_course.at = change;
    other_course.valid_s = 7200;
    const auto course = simulator::find_course("T2");
    for (std::size_t i = 0; i < course->marks.size(); ++i)
        other_course.steps.push_back(commands::mission_stage{static_cast<std::uint8_t>(i), course->marks[i]});
    other_course.steps.push_back(
        commands::mission_switch{static_cast<std::uint8_t>(course->marks.size()), mission_checksum(course->marks)});
    other_course.steps.push_back(commands::set_mode{sailing_mode::automatic});
    made.orders.push_back(std::move(other_course));
    std::stable_sort(made.orders.begin(), made.orders.end(),
                     [](const order& a, const order& b) { return a.at < b.at; });
}

voyage_plan begin_plan(generator& dice, ise::duration length) {
    voyage_plan made;
    made.length = length;
    made.wind_speed_mps = std::round(between(dice, 5, 8) * 10) / 10;
    made.wind_from_deg = std::round(between(dice, 20, 70));
    made.iridium_period_s = std::clamp(std::round(std::chrono::duration<double>(length).count() / 60), 60.0, 600.0);
    return made;
}
void finish_plan(voyage_plan& made, generator& dice) {
    for (auto& one : made.faults)
        if (one.what == trouble::database_crashed || one.what == trouble::database_stopped)
            one.length = std::min<ise::duration>(one.length, 30s);
    std::stable_sort(made.faults.begin(), made.faults.end(),
                     [](const fault& a, const fault& b) { return a.at < b.at; });
    give_orders(made, dice);
}

} // namespace

voyage_plan make_plan(std::uint64_t seed, ise::duration length, bool database) {
    generator dice(seed, "plan");
    auto made = begin_plan(dice, length);
    const auto hours = static_cast<std::size_t>(std::chrono::duration_cast<std::chrono::hours>(length).count());
    using enum trouble;
    fault away;
    away.what = operator_away;
    away.at = part_of(length, between(dice, 0.60, 0.66));
    away.length = part_of(length, between(dice, 0.06, 0.10));
    made.faults.push_back(away);
    // Nodes more often than the others, and every other time with an older disk.
    std::vector victims{primary_killed,     secondary_killed,      names_restarted, xbee_proxy_crashed,
                        gprs_proxy_crashed, iridium_proxy_crashed, page_crashed,    boat_killed,
                        primary_set_back,   secondary_set_back};
    if (database) victims.insert(victims.end(), {database_crashed, database_stopped});
    const auto slots = std::max<std::size_t>(victims.size(), hours + 4);
    fill(made, dice, std::move(victims), slots, 8min);
    fill(made, dice, {carrier_down, carrier_drops, carrier_half_open, carrier_moves, carrier_slow},
         std::max<std::size_t>(5, hours * 3 / 2), 15min);
    fill(made, dice, {sky_closed, sky_fails, gateway_down}, std::max<std::size_t>(3, hours / 2), 25min);
    fill(made, dice, {air_noise}, std::max<std::size_t>(1, hours / 2), 12min);
    fill(made, dice, {nodes_parted}, std::max<std::size_t>(1, hours / 3), 5min);
    finish_plan(made, dice);
    return made;
}

voyage_plan make_short_plan(std::uint64_t seed, ise::duration length, bool database) {
    generator dice(seed, "plan");
    auto made = begin_plan(dice, length);
    made.iridium_period_s = std::clamp(std::chrono::duration<double>(length).count() / 6, 10.0, 60.0);
    auto add = [&](trouble what, double at, double part) {
        fault one;
        one.what = what;
        one.at = part_of(length, at);
        one.length = part_of(length, part);
        made.faults.push_back(one);
    };
    using enum trouble;
    // Links, while all processes are there or one is down.
    add(carrier_down, 0.08, 0.10);
    add(carrier_half_open, 0.30, 0);
    add(air_off, 0.44, 0.14);
    add(sky_closed, 0.20, 0.12);
    add(carrier_drops, 0.62, 0);
    add(operator_away, 0.64, 0.14);
    // Processes, one after the other, in an order of the dice.
    std::vector<trouble> victims{primary_killed, names_restarted, secondary_killed,
                                 page_crashed,   boat_killed,     gprs_proxy_crashed};
    if (database) victims.insert(victims.end(), {database_crashed, database_stopped});
    shuffle(dice, victims);
    const double apart = 0.78 / static_cast<double>(victims.size());
    for (std::size_t i = 0; i < victims.size(); ++i) add(victims[i], 0.14 + apart * static_cast<double>(i), 0.06);
    finish_plan(made, dice);
    return made;
}

} // namespace atirma::stress
