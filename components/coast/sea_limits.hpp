#pragma once
#include <components/coast/geofence.hpp>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

/// Where a boat can sail: off the land, and within its fence. Shore and boat use the same.
///
/// Lines are straight on a chart whose degrees of longitude are shortened by the latitude: good to a few metres within
/// a coast's detail. The coast is that of coast.hpp, which ends with its island: there is no land elsewhere.
/// Immutable; thread-safe.
class sea_limits {
public:
    /// `land`: the coast of coast.hpp counts.
    explicit sea_limits(geofence fence = geofence(), bool land = true);

    /// The coast without a fence. Made once.
    static std::shared_ptr<const sea_limits> coast_only();

    const geofence& fence() const noexcept { return fence_; }
    bool on_land(coast_point at) const;
    /// Within the areas to keep in, and outside of those to keep out.
    bool within_fence(coast_point at) const;

    /// Why a boat should not sail straight from `from` to `to`, for people: "crosses land 420 m from its start",
    /// "leaves the fence after 1.2 km". Nothing: it may. A leg that starts beyond a limit is judged by where it leads.
    std::optional<std::string> trouble(coast_point from, coast_point to) const;
    /// Why a boat should not go there: "is on land", "is outside the fence".
    std::optional<std::string> trouble(coast_point at) const;

    /// The same for the fence alone.
    std::optional<std::string> fence_trouble(coast_point from, coast_point to) const;

    /// The distance along the line from `from` to `to` to the first land; 0 on land; nothing: it meets none.
    std::optional<double> metres_to_land(coast_point from, coast_point to) const;

    /// The distance to the nearest limit, at most `at_most_m`; negative beyond the fence or on land.
    double clearance_m(coast_point at, double at_most_m) const;
    /// The same for the fence alone.
    double fence_clearance_m(coast_point at, double at_most_m) const;

private:
    /// A range of latitudes, and one of longitudes.
    struct box {
        double south, north, middle, half; ///< `middle` is -180 … 180
        bool meets(const box& other) const noexcept;
    };
    struct ring {
        std::vector<coast_point> points;
        std::vector<double> east; ///< degrees from the first, unwound: an area over the antimeridian is in one piece
        double middle;            ///< of `east`
        box around;
    };
    struct edge {
        coast_point from, to;
    };
    struct area {
        std::vector<ring> rings;
        bool keep_out;
        std::string name;
    };
    static ring make_ring(std::vector<coast_point> points);
    static box box_of(coast_point from, coast_point to);
    static box box_of(coast_point at);
    static bool inside(const std::vector<ring>& rings, coast_point at, const box& here);
    static std::optional<double> first_crossing(const std::vector<ring>& rings, coast_point from, coast_point to);
    static double distance_m(const std::vector<ring>& rings, coast_point at, double at_most_m);
    bool meets_other(const area& mine, coast_point from, coast_point to) const;
    std::vector<double> parts_of(const area& mine, coast_point from, coast_point to) const;
    void find_fence_limits();

    geofence fence_;
    std::vector<ring> land_;
    std::vector<area> areas_;
    bool keeps_in_ = false;          ///< one of the areas does
    std::vector<edge> fence_limits_; ///< the parts of the areas' edges with only one side within the fence
};

/// Metres between two places, as `sea_limits` measures them.
double flat_distance_m(coast_point a, coast_point b) noexcept;
/// The place so far from `from` in that direction.
coast_point flat_destination(coast_point from, double course_deg, double metres) noexcept;

} // namespace atirma
