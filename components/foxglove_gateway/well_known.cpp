#include <components/foxglove_gateway/well_known.hpp>

#include <ise/core/bytes.hpp>

#include <bit>
#include <cmath>
#include <initializer_list>

namespace ise::foxglove {
namespace {

// --- protobuf -------------------------------------------------------------------------------------------------------

void put_varint(std::string& to, std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) to += static_cast<char>(value | 0x80);
    to += static_cast<char>(value);
}
void put_number(std::string& to, std::uint32_t field, std::uint64_t value) {
    put_varint(to, std::uint64_t{field} << 3);
    put_varint(to, value);
}
void put_block(std::string& to, std::uint32_t field, std::string_view content) {
    put_varint(to, std::uint64_t{field} << 3 | 2);
    put_varint(to, content.size());
    to += content;
}
void put_double(std::string& to, std::uint32_t field, double value) {
    put_varint(to, std::uint64_t{field} << 3 | 1);
    auto bits = std::bit_cast<std::uint64_t>(value);
    for (int shift = 0; shift < 64; shift += 8) to += static_cast<char>(bits >> shift & 0xff);
}
void put_time(std::string& to, std::uint32_t field, wall_time at) {
    auto seconds = std::chrono::floor<std::chrono::seconds>(at);
    std::string made;
    put_number(made, 1, static_cast<std::uint64_t>(seconds.time_since_epoch().count()));
    put_number(made, 2, static_cast<std::uint64_t>((at - seconds).count()));
    put_block(to, field, made);
}

// --- descriptors (google/protobuf/descriptor.proto) ------------------------------------------------------------------

enum class kind : std::uint8_t { f64 = 1, i64 = 3, i32 = 5, text = 9, message = 11 };

struct field {
    const char* name;
    std::uint32_t number;
    kind type;
    const char* message = ""; // its full name
    bool has_presence = false;
};

std::string message(const char* name, std::initializer_list<field> fields) {
    std::string made;
    put_block(made, 1, name);
    std::uint64_t oneofs = 0;
    for (const auto& one : fields) {
        std::string about;
        put_block(about, 1, one.name);
        put_number(about, 3, one.number);
        put_number(about, 4, 1); // one value
        put_number(about, 5, static_cast<std::uint64_t>(one.type));
        if (*one.message) put_block(about, 6, one.message);
        if (one.has_presence) {
            put_number(about, 9, oneofs++);
            put_number(about, 17, 1);
        }
        put_block(made, 2, about);
    }
    for (const auto& one : fields) {
        if (!one.has_presence) continue;
        std::string oneof;
        put_block(oneof, 1, std::string("_") + one.name);
        put_block(made, 8, oneof);
    }
    return made;
}

std::string file(const char* name, const char* package, std::initializer_list<const char*> needs,
                 std::initializer_list<std::string> messages) {
    std::string made;
    put_block(made, 1, name);
    put_block(made, 2, package);
    for (const auto* one : needs) put_block(made, 3, one);
    for (const auto& one : messages) put_block(made, 4, one);
    put_block(made, 12, "proto3");
    return made;
}

constexpr const char* timestamp_file = "google/protobuf/timestamp.proto";
constexpr const char* timestamp = ".google.protobuf.Timestamp";

schema_info schema(const char* name, std::initializer_list<std::string> files) {
    std::string set;
    for (const auto& one : files) put_block(set, 1, one);
    return protobuf_schema(name, as_bytes(set));
}

std::string timestamps() {
    return file(timestamp_file, "google.protobuf", {},
                {message("Timestamp", {{"seconds", 1, kind::i64}, {"nanos", 2, kind::i32}})});
}

} // namespace

const schema_info& location_fix_schema() {
    static const auto made = schema(
        "foxglove.LocationFix", {timestamps(), file("foxglove/LocationFix.proto", "foxglove", {timestamp_file},
                                                    {message("LocationFix", {{"timestamp", 6, kind::message, timestamp},
                                                                             {"frame_id", 7, kind::text},
                                                                             {"latitude", 1, kind::f64},
                                                                             {"longitude", 2, kind::f64},
                                                                             {"altitude", 3, kind::f64},
                                                                             {"heading", 10, kind::f64, "", true},
                                                                             {"speed", 12, kind::f64, "", true},
                                                                             {"course", 13, kind::f64, "", true}})})});
    return made;
}

std::string encode(const location_fix& of) {
    std::string made;
    put_double(made, 1, of.latitude_deg);
    put_double(made, 2, of.longitude_deg);
    put_double(made, 3, of.altitude_m);
    put_time(made, 6, of.at);
    put_block(made, 7, of.frame);
    if (of.heading_rad) put_double(made, 10, *of.heading_rad);
    if (of.speed_mps) put_double(made, 12, *of.speed_mps);
    if (of.course_rad) put_double(made, 13, *of.course_rad);
    return made;
}

void frame_transform::turn(double yaw_rad, double pitch_rad, double roll_rad) {
    const double cy = std::cos(yaw_rad / 2), sy = std::sin(yaw_rad / 2);
    const double cp = std::cos(pitch_rad / 2), sp = std::sin(pitch_rad / 2);
    const double cr = std::cos(roll_rad / 2), sr = std::sin(roll_rad / 2);
    qw = cr * cp * cy + sr * sp * sy;
    qx = sr * cp * cy - cr * sp * sy;
    qy = cr * sp * cy + sr * cp * sy;
    qz = cr * cp * sy - sr * sp * cy;
}

const schema_info& frame_transform_schema() {
    static const auto made =
        schema("foxglove.FrameTransform",
               {timestamps(),
                file("foxglove/Vector3.proto", "foxglove", {},
                     {message("Vector3", {{"x", 1, kind::f64}, {"y", 2, kind::f64}, {"z", 3, kind::f64}})}),
                file("foxglove/Quaternion.proto", "foxglove", {},
                     {message("Quaternion",
                              {{"x", 1, kind::f64}, {"y", 2, kind::f64}, {"z", 3, kind::f64}, {"w", 4, kind::f64}})}),
                file("foxglove/FrameTransform.proto", "foxglove",
                     {"foxglove/Quaternion.proto", "foxglove/Vector3.proto", timestamp_file},
                     {message("FrameTransform", {{"timestamp", 1, kind::message, timestamp},
                                                 {"parent_frame_id", 2, kind::text},
                                                 {"child_frame_id", 3, kind::text},
                                                 {"translation", 4, kind::message, ".foxglove.Vector3"},
                                                 {"rotation", 5, kind::message, ".foxglove.Quaternion"}})})});
    return made;
}

std::string encode(const frame_transform& of) {
    std::string made, translation, rotation;
    put_double(translation, 1, of.x_m);
    put_double(translation, 2, of.y_m);
    put_double(translation, 3, of.z_m);
    put_double(rotation, 1, of.qx);
    put_double(rotation, 2, of.qy);
    put_double(rotation, 3, of.qz);
    put_double(rotation, 4, of.qw);
    put_time(made, 1, of.at);
    put_block(made, 2, of.parent);
    put_block(made, 3, of.child);
    put_block(made, 4, translation);
    put_block(made, 5, rotation);
    return made;
}

const schema_info& geojson_schema() {
    static const auto made =
        schema("foxglove.GeoJSON",
               {file("foxglove/GeoJSON.proto", "foxglove", {}, {message("GeoJSON", {{"geojson", 1, kind::text}})})});
    return made;
}

std::string encode_geojson(std::string_view geojson) {
    std::string made;
    put_block(made, 1, geojson);
    return made;
}

} // namespace ise::foxglove
