#pragma once
#include <components/coast/coast.hpp>

#include <ise/core/result.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace atirma {

/// One polygon of a fence: the boat stays inside it, or outside.
struct fence_area {
    std::string name;
    bool keep_out = false;
    std::vector<std::vector<coast_point>> rings; ///< closed; the first is the outline, the others are holes
};

/// Where a boat may sail: inside one of the areas to keep in (if there are any), and outside of all areas to keep out.
class geofence {
public:
    static constexpr std::size_t max_bytes = 1 << 20;
    static constexpr std::size_t max_points = 10'000;

    /// Reads GeoJSON (RFC 7946): a Polygon, a MultiPolygon, a Feature or a FeatureCollection of them. The property
    /// `fence` of a feature is "keep-in" (default) or "keep-out"; `name` is shown. `source` names the file in errors.
    /// Errors: malformed (not GeoJSON, another geometry, an open ring, a number out of range, or nothing in it);
    /// too_large.
    static ise::result<geofence> parse(std::string_view geojson, std::string_view source);

    bool empty() const noexcept { return areas_.empty(); }
    const std::vector<fence_area>& areas() const noexcept { return areas_; }

private:
    std::vector<fence_area> areas_;
};

} // namespace atirma
