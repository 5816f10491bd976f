#pragma once
#include <components/gui_client/view.hpp>

#include <memory>
#include <optional>

namespace atirma::console {

/// What the chart shows of the boat.
struct chart_scene {
    std::shared_ptr<const snapshot> seen; ///< null until the first snapshot
    utc_time now{};
    double tail_s = 0; ///< only so much of the track is drawn; 0: all

    std::optional<waypoint> boat() const {
        if (!seen || !seen->boat.position) return std::nullopt;
        const auto& at = seen->boat.position->value;
        return waypoint{at.latitude_deg, at.longitude_deg};
    }
};

} // namespace atirma::console
