#pragma once
#include <components/gui_client/view.hpp>

#include <QString>

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

namespace atirma::console {

/// Where the boat was last; empty: never heard.
inline std::optional<waypoint> place_of(const snapshot& seen) {
    if (!seen.boat.position) return std::nullopt;
    const auto& at = seen.boat.position->value;
    return waypoint{at.latitude_deg, at.longitude_deg};
}

/// A boat of the fleet that is not the shown one. Its place is known.
struct other_boat {
    std::size_t number = 0;
    QString name;
    std::shared_ptr<const snapshot> seen; ///< never null
    waypoint at;
};

/// The content of the chart: one boat with its track and waypoints, and the places of the other boats of its fleet.
struct chart_scene {
    std::shared_ptr<const snapshot> seen; ///< null until the first snapshot
    utc_time now{};
    double tail_s = 0; ///< only so much of the track is drawn; 0: all
    std::vector<other_boat> others;
    QString ended; ///< why nothing newer comes; empty: the boat is followed

    std::optional<waypoint> boat() const { return seen ? place_of(*seen) : std::nullopt; }
};

} // namespace atirma::console
