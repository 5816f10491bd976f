#pragma once
#include <components/gui_client/view.hpp>

namespace atirma::console {

/// How much a value is still worth.
enum class freshness : std::uint8_t { none, fresh, ageing, stale };

/// What is told about how often.
enum class value_kind : std::uint8_t { position, sailing, breeze, supply, settings, waypoints, links };

/// Seconds since it was measured, never negative: a boat whose clock is ahead tells what is new.
double age_s(utc_time now, utc_time measured_at) noexcept;

/// How often a value of that kind is due over a link, in seconds, by what the boat said its periods are.
double expected_period_s(value_kind kind, link_id link, const std::optional<heard<configuration>>& settings) noexcept;

/// Fresh for three periods (6 s at least), stale after ten (30 s at least), between them ageing.
freshness judge(double age_s, double expected_s) noexcept;

template <class Packet>
freshness freshness_of(const std::optional<heard<Packet>>& value, value_kind kind, const boat_view& boat,
                       utc_time now) noexcept {
    if (!value) return freshness::none;
    return judge(age_s(now, value->measured_at), expected_period_s(kind, value->link, boat.settings));
}

/// "now", "12 s", "3 min", "2 h 05", "4 d".
std::string age_text(double seconds);

/// Seconds to the waypoint at the speed made good towards it; nothing where it does not come nearer.
std::optional<double> time_to_waypoint_s(const boat_view& boat) noexcept;

} // namespace atirma::console
