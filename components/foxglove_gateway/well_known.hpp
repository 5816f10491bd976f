#pragma once
#include <components/foxglove_gateway/protocol.hpp>

#include <optional>
#include <string>

/// Schemas that viewers show without settings, as protobuf: for derived channels.
namespace ise::foxglove {

/// foxglove.LocationFix: a point of the map panel.
struct location_fix {
    wall_time at{};
    std::string frame;
    double latitude_deg = 0, longitude_deg = 0, altitude_m = 0;
    std::optional<double> heading_rad, course_rad; ///< clockwise from true north
    std::optional<double> speed_mps;
};
const schema_info& location_fix_schema();
std::string encode(const location_fix& of);

/// foxglove.FrameTransform: where `child` is in `parent`, for the 3D panel. x forward or east, y left or north, z up.
struct frame_transform {
    wall_time at{};
    std::string parent, child;
    double x_m = 0, y_m = 0, z_m = 0;
    double qx = 0, qy = 0, qz = 0, qw = 1; ///< a rotation, as a unit quaternion
    /// Sets the rotation: about z, then the new y, then the new x, each by the right-hand rule.
    void turn(double yaw_rad, double pitch_rad, double roll_rad);
};
const schema_info& frame_transform_schema();
std::string encode(const frame_transform& of);

/// foxglove.GeoJSON: anything on the map panel.
const schema_info& geojson_schema();
std::string encode_geojson(std::string_view geojson);

} // namespace ise::foxglove
