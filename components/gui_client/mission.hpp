#pragma once
#include <components/gui_client/view.hpp>

#include <map>
#include <vector>

namespace atirma::console {

/// Metres between two places (a sphere; for distances of a bay).
double distance_m(const waypoint& a, const waypoint& b) noexcept;
/// True bearing from `a` to `b`, 0 <= x < 360.
double bearing_deg(const waypoint& a, const waypoint& b) noexcept;

/// Whether a boat with this cross-track error (positive: right of the leg) may be sailing from `from` to `to`. A boat
/// that was sent to a waypoint from elsewhere sails another leg.
bool lies_on_leg(const waypoint& from, const waypoint& to, const waypoint& boat, float cross_track_error_m) noexcept;

enum class difference : std::uint8_t { same, moved, only_here, only_on_boat };

/// One place of two lists.
struct mission_difference {
    difference what = difference::same;
    double moved_m = 0;
};

/// Place by place, as long as the longer list. Places that differ by less than the resolution on air are the same.
std::vector<mission_difference> compare(const std::vector<waypoint>& on_boat, const std::vector<waypoint>& here);
/// Whether nothing differs.
bool same(const std::vector<waypoint>& on_boat, const std::vector<waypoint>& here);
/// "2 differ", "the boat has 3, here are 4; 1 differs"; "no difference".
std::string describe_differences(const std::vector<waypoint>& on_boat, const std::vector<waypoint>& here);

/// Assembles the list of waypoints from the parts that the boat reports. Parts of two revisions, or from before and
/// after a restart of the boat, are not mixed. Pure.
class mission_parts {
public:
    /// True if the view has changed. A part that comes late (measured before the newest one), of another revision or
    /// from before a restart, is ignored: the boat has another list by now.
    bool take(std::uint16_t boot, const waypoints& part, utc_time measured_at, utc_time now);
    const mission_view& view() const noexcept { return view_; }
    /// Whether the whole list has been reported again since then.
    bool complete_since(utc_time then) const noexcept {
        return view_.complete && view_.told_at && *view_.told_at >= then;
    }

private:
    struct entry {
        waypoint at;
        utc_time told_at{};
    };
    std::uint16_t boot_ = 0;
    utc_time newest_{}; ///< measured
    std::map<std::size_t, entry> parts_;
    mission_view view_;
};

} // namespace atirma::console
