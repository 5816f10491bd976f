#pragma once
#include <components/gui_client/view.hpp>

#include <map>
#include <vector>

namespace atirma::console {

/// Metres between two places (a sphere; for distances of a bay).
double distance_m(const waypoint& a, const waypoint& b) noexcept;
/// True bearing from `a` to `b`, 0 <= x < 360.
double bearing_deg(const waypoint& a, const waypoint& b) noexcept;

/// Whether a boat that tells this cross-track error (right of the leg is positive) may be sailing from `from` to `to`:
/// one that was sent to a waypoint from the middle of the sea sails another leg.
bool lies_on_leg(const waypoint& from, const waypoint& to, const waypoint& boat, float cross_track_error_m) noexcept;

enum class difference : std::uint8_t { same, moved, only_here, only_on_boat };

/// One place of two lists.
struct mission_difference {
    difference what = difference::same;
    double moved_m = 0;
};

/// Place by place, as long as the longer list. Places that differ by less than what goes on air are the same.
std::vector<mission_difference> compare(const std::vector<waypoint>& on_boat, const std::vector<waypoint>& here);
/// Whether nothing differs.
bool same(const std::vector<waypoint>& on_boat, const std::vector<waypoint>& here);
/// "2 differ", "the boat has 3, here are 4; 1 differs"; "no difference".
std::string describe_differences(const std::vector<waypoint>& on_boat, const std::vector<waypoint>& here);

/// Puts the list of waypoints together from the parts that the boat tells. Parts of two revisions, or of two lives of
/// the boat, do not mix. Pure.
class mission_parts {
public:
    /// True if the view has changed.
    bool take(std::uint16_t boot, const waypoints& part, utc_time now);
    const mission_view& view() const noexcept { return view_; }
    /// Whether the whole list has been told again since then.
    bool complete_since(utc_time then) const noexcept {
        return view_.complete && view_.told_at && *view_.told_at >= then;
    }

private:
    struct entry {
        waypoint at;
        utc_time told_at{};
    };
    std::uint16_t boot_ = 0;
    std::map<std::size_t, entry> parts_;
    mission_view view_;
};

} // namespace atirma::console
