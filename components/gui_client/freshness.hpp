#pragma once
#include <components/gui_client/view.hpp>

namespace atirma::console {

/// How current a value is.
enum class freshness : std::uint8_t { none, fresh, ageing, stale };

/// Kinds of values that the boat reports at different rates.
enum class value_kind : std::uint8_t { position, sailing, breeze, supply, settings, waypoints, links };

/// Seconds since it was measured, never negative: if the boat's clock is ahead, the value counts as new.
double age_s(utc_time now, utc_time measured_at) noexcept;

/// The expected period of a value over a link in seconds, by the periods that the boat reported.
double expected_period_s(value_kind kind, link_id link, const std::optional<heard<configuration>>& settings) noexcept;

/// Fresh for three periods (at least 6 s), stale after ten (at least 30 s), ageing in between.
freshness judge(double age_s, double expected_s) noexcept;

template <class Packet>
freshness freshness_of(const std::optional<heard<Packet>>& value, value_kind kind, const boat_view& boat,
                       utc_time now) noexcept {
    if (!value) return freshness::none;
    return judge(age_s(now, value->measured_at), expected_period_s(kind, value->link, boat.settings));
}

/// "now", "12 s", "3 min", "2 h 05", "4 d".
std::string age_text(double seconds);

/// Seconds to the waypoint at the speed made good towards it; empty if the boat does not come nearer.
std::optional<double> time_to_waypoint_s(const boat_view& boat) noexcept;

} // namespace atirma::console
