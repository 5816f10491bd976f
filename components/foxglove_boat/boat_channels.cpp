#include <components/foxglove_boat/boat_channels.hpp>

#include <components/boat/newest_reports.hpp>
#include <components/boat/services.hpp>
#include <components/foxglove_gateway/well_known.hpp>

#include <ise/bag/protobuf.hpp>
#include <ise/core/buffer.hpp>
#include <ise/packet/codec.hpp>

#include <fmt/format.h>

#include <cmath>
#include <deque>
#include <numbers>
#include <optional>

namespace atirma {
namespace {

using namespace ise::foxglove;

constexpr double radians = std::numbers::pi / 180;
constexpr double metres_per_degree = 111'195; // of latitude, on a sphere
constexpr std::size_t track_length = 2000;    // positions
constexpr double track_step_m = 5;            // between them
constexpr double track_jump_m = 5000;         // more is another place, where the map begins anew

enum place : std::size_t { fix, attitude, wind_frame, track, of_location, of_navigation, of_wind, of_power };

struct point {
    double east_m = 0, north_m = 0;
};

class boat_derivation final : public derivation {
public:
    explicit boat_derivation(const std::string& path) {
        auto add = [&](const char* name, const schema_info& schema) {
            channels_.push_back({fmt::format("{}/{}", path, name), schema});
        };
        auto add_report = [&](const char* name, const ise::bag::protobuf_type& type) {
            add(name, protobuf_schema(type.name(), type.descriptors()));
        };
        add("fix", location_fix_schema());
        add("attitude", frame_transform_schema());
        add("wind_frame", frame_transform_schema());
        add("track", geojson_schema());
        add_report("location", location_type_);
        add_report("navigation", navigation_type_);
        add_report("wind", wind_type_);
        add_report("power", power_type_);
    }

    const std::vector<channel>& channels() const override { return channels_; }
    bool always() const override { return true; } // the track

    void take(const ise::dynamic_packet& packet, ise::wall_time at, std::vector<derived_message>& to) override {
        auto result = packet.as<telemetry_packet>();
        const auto malformed = reports_.malformed();
        auto kind = reports_.take(result);
        if (reports_.malformed() != malformed)
            throw ise::error(ise::errc::malformed, "a report of the boat cannot be read");
        if (!kind) return;
        if (*kind == telemetry_body(location{}).index() && reports_.location()) {
            on_location(at, to);
            report(of_location, location_type_, reports_.location()->value, at, to);
        } else if (*kind == telemetry_body(navigation{}).index() && reports_.navigation()) {
            if (position_) to.push_back({attitude, at, encode(transform(at))});
            report(of_navigation, navigation_type_, reports_.navigation()->value, at, to);
        } else if (*kind == telemetry_body(wind{}).index() && reports_.wind()) {
            if (position_) to.push_back({wind_frame, at, encode(wind_transform(at))});
            report(of_wind, wind_type_, reports_.wind()->value, at, to);
        } else if (*kind == telemetry_body(power{}).index() && reports_.power()) {
            report(of_power, power_type_, reports_.power()->value, at, to);
        }
    }

private:
    template <class Report>
    static void report(std::size_t channel, const ise::bag::protobuf_type& type, const Report& value, ise::wall_time at,
                       std::vector<derived_message>& to) {
        ise::buffer made;
        type.encode(ise::encode(value), made, false).value();
        to.push_back({channel, at, std::string(ise::as_text(made.view()))});
    }

    void on_location(ise::wall_time at, std::vector<derived_message>& to) {
        const auto& where = reports_.location()->value;
        location_fix made;
        made.at = reports_.location()->measured_at;
        made.frame = "boat";
        made.latitude_deg = where.latitude_deg;
        made.longitude_deg = where.longitude_deg;
        made.speed_mps = where.speed_over_ground_mps;
        made.course_rad = where.course_over_ground_deg * radians;
        if (reports_.navigation()) made.heading_rad = reports_.navigation()->value.heading_deg * radians;
        to.push_back({fix, at, encode(made)});

        auto here = metres(where);
        if (!origin_ || std::hypot(here.east_m - position_->east_m, here.north_m - position_->north_m) > track_jump_m) {
            origin_ = where;
            track_.clear();
            here = point{};
        }
        position_ = here;
        if (reports_.navigation()) to.push_back({attitude, at, encode(transform(at))});
        if (reports_.wind()) to.push_back({wind_frame, at, encode(wind_transform(at))});
        auto last = track_.empty() ? std::optional<point>() : metres(track_.back());
        if (last && std::hypot(here.east_m - last->east_m, here.north_m - last->north_m) < track_step_m) return;
        track_.push_back(where);
        if (track_.size() > track_length) track_.pop_front();
        to.push_back({track, at, encode_geojson(line())});
    }

    point metres(const location& of) const {
        if (!origin_) return {};
        auto east_deg = std::remainder(of.longitude_deg - origin_->longitude_deg, 360.0);
        return {east_deg * metres_per_degree * std::cos(origin_->latitude_deg * radians),
                (of.latitude_deg - origin_->latitude_deg) * metres_per_degree};
    }

    frame_transform at_boat(ise::wall_time at, const char* child) const {
        frame_transform made;
        made.at = at;
        made.parent = "map";
        made.child = child;
        made.x_m = position_->east_m;
        made.y_m = position_->north_m;
        return made;
    }
    // Headings turn clockwise from north, frames anticlockwise from east; bow up and starboard down are positive.
    frame_transform transform(ise::wall_time at) const {
        const auto& how = reports_.navigation()->value;
        auto made = at_boat(at, "boat");
        made.turn((90 - how.heading_deg) * radians, -how.pitch_deg * radians, how.heel_deg * radians);
        return made;
    }
    frame_transform wind_transform(ise::wall_time at) const {
        auto made = at_boat(at, "wind");
        made.turn((270 - reports_.wind()->value.true_direction_deg) * radians, 0, 0);
        return made;
    }

    std::string line() const {
        std::string made = R"({"type":"Feature","properties":{"name":"track"},"geometry":{"type":"LineString",)"
                           R"("coordinates":[)";
        auto add = [&](const location& one) {
            made += fmt::format("[{:.6f},{:.6f}]", one.longitude_deg, one.latitude_deg);
        };
        for (const auto& one : track_) {
            if (&one != &track_.front()) made += ',';
            add(one);
        }
        if (track_.size() == 1) { // a line has two ends
            made += ',';
            add(track_.front());
        }
        return made + "]}}";
    }

    const ise::bag::protobuf_type location_type_{ise::schema_of<location>()},
        navigation_type_{ise::schema_of<navigation>()}, wind_type_{ise::schema_of<wind>()},
        power_type_{ise::schema_of<power>()};
    std::vector<channel> channels_;
    newest_reports reports_;
    std::optional<location> origin_;
    std::optional<point> position_;
    std::deque<location> track_;
};

} // namespace

std::unique_ptr<derivation> boat_channels(const std::string& component, const ise::dynamic_contract& service) {
    const auto& telemetry = ise::schema_of<telemetry_packet>();
    if (service.name() != services::telemetry.name() || service.kind() != ise::service_kind::subscription)
        return nullptr;
    if (service.packet(ise::role::published).name() != telemetry.name()) return nullptr;
    return std::make_unique<boat_derivation>(component);
}

} // namespace atirma
