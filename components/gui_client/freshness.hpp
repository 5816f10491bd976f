#pragma once
#include <components/boat/report_rhythm.hpp>
#include <components/gui_client/view.hpp>

namespace atirma::console {

using atirma::value_kind;

/// How current a value is.
enum class freshness : std::uint8_t { none, fresh, ageing, stale };

/// Seconds since it was measured, never negative: if the boat's clock is ahead, the value counts as new.
double age_s(utc_time now, utc_time measured_at) noexcept;

/// By the rule that the tracking page has too (`limits_of`).
freshness judge(double age_s, double expected_s) noexcept;

template <class Packet>
freshness freshness_of(const std::optional<heard<Packet>>& value, value_kind kind, const boat_view& boat,
                       utc_time now) noexcept {
    if (!value) return freshness::none;
    return judge(age_s(now, value->measured_at), period_of(kind, boat.rhythm.position_s(value->link)));
}

/// "now", "12 s", "3 min", "2 h 05", "4 d".
std::string age_text(double seconds);

/// Seconds to the waypoint at the speed made good towards it; empty if the boat does not come nearer.
std::optional<double> time_to_waypoint_s(const boat_view& boat) noexcept;

} // namespace atirma::console
