#pragma once
#include <components/coast/sea_limits.hpp>
#include <components/gui_client/alarm.hpp>
#include <components/gui_client/view.hpp>

#include <memory>
#include <optional>

namespace atirma::console {

/// In how many seconds the boat meets land if it goes on as it does: on its course over ground; in Auto, RTL and Loiter
/// only as far as its waypoint if it makes good towards that, and in Auto from there on along its list. Reckoned from
/// its last position, so that the time passes between two reports; negative: it should have met it. Nothing: no land
/// within `within_s`, or it does not move. Pure.
std::optional<double> seconds_to_land(const sea_limits& limits, const boat_view& boat, const mission_view& mission,
                                      utc_time now, double within_s);

/// Raises the alarms `land` (land within ten minutes, critical) and `fence` (outside the fence). A course that points
/// to the land for a moment only, in a turn, raises none while there is time. Pure.
class course_watch {
public:
    static constexpr double warn_s = 600, surely_s = 420;

    explicit course_watch(std::shared_ptr<const sea_limits> limits) : limits_(std::move(limits)) {}
    void apply(alarm_book& alarms, const boat_view& boat, const mission_view& mission, utc_time now);

private:
    std::shared_ptr<const sea_limits> limits_;
    std::optional<utc_time> since_, clear_since_;
};

} // namespace atirma::console
