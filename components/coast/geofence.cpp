#include <components/coast/geofence.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cmath>

namespace atirma {
namespace {

using nlohmann::json;

/// Reads areas; the first problem is kept, and the rest is not read.
class fence_reader {
public:
    std::vector<fence_area> areas;
    std::string problem;

    void read(const json& what) {
        if (!what.is_object() || !what.contains("type") || !what["type"].is_string())
            return fail("it is not a GeoJSON object with a type");
        auto type = what["type"].get<std::string>();
        if (type == "FeatureCollection") {
            if (!what.contains("features") || !what["features"].is_array())
                return fail("a FeatureCollection without features");
            for (const auto& feature : what["features"]) {
                ++feature_;
                read_feature(feature);
            }
        } else if (type == "Feature") {
            ++feature_;
            read_feature(what);
        } else {
            read_geometry(what, fence_area());
        }
    }

private:
    void fail(const std::string& why) {
        if (!problem.empty()) return;
        problem = feature_ > 0 ? fmt::format("feature {}: {}", feature_, why) : why;
    }

    void read_feature(const json& feature) {
        if (!feature.is_object() || feature.value("type", json()) != "Feature") return fail("it is not a Feature");
        if (!feature.contains("geometry")) return fail("it has no geometry");
        fence_area area;
        if (auto properties = feature.find("properties"); properties != feature.end() && properties->is_object()) {
            if (auto name = properties->find("name"); name != properties->end() && name->is_string())
                area.name = name->get<std::string>();
            if (auto fence = properties->find("fence"); fence != properties->end()) {
                if (*fence != "keep-in" && *fence != "keep-out")
                    return fail("its property 'fence' is neither \"keep-in\" nor \"keep-out\"");
                area.keep_out = *fence == "keep-out";
            }
        }
        read_geometry(feature["geometry"], area);
    }

    void read_geometry(const json& geometry, const fence_area& like) {
        if (!geometry.is_object()) return fail("its geometry is not an object");
        auto type = geometry.value("type", json());
        auto places = geometry.find("coordinates");
        if (type != "Polygon" && type != "MultiPolygon")
            return fail("its geometry is neither a Polygon nor a MultiPolygon");
        if (places == geometry.end() || !places->is_array() || places->empty()) return fail("it has no coordinates");
        if (type == "Polygon") return read_polygon(*places, like);
        for (const auto& polygon : *places) read_polygon(polygon, like);
    }

    void read_polygon(const json& rings, fence_area area) {
        if (!rings.is_array() || rings.empty()) return fail("a polygon without a ring");
        for (const auto& ring : rings) {
            if (!ring.is_array() || ring.size() < 4) return fail("a ring with fewer than four positions");
            std::vector<coast_point> points;
            for (const auto& at : ring) {
                if (++points_ > geofence::max_points)
                    return fail(fmt::format("more than {} positions", geofence::max_points));
                if (!at.is_array() || at.size() < 2 || !at[0].is_number() || !at[1].is_number())
                    return fail("a position that is not [longitude, latitude]");
                coast_point point{at[1].get<double>(), at[0].get<double>()};
                if (!(std::abs(point.latitude_deg) <= 90) || !(std::abs(point.longitude_deg) <= 180))
                    return fail(fmt::format("no such place: longitude {}, latitude {}", at[0].dump(), at[1].dump()));
                points.push_back(point);
            }
            if (points.front().latitude_deg != points.back().latitude_deg ||
                points.front().longitude_deg != points.back().longitude_deg)
                return fail("a ring whose last position is not its first");
            area.rings.push_back(std::move(points));
        }
        areas.push_back(std::move(area));
    }

    std::size_t feature_ = 0, points_ = 0;
};

} // namespace

ise::result<geofence> geofence::parse(std::string_view geojson, std::string_view source) {
    if (geojson.size() > max_bytes)
        return ise::failure(ise::errc::too_large,
                            fmt::format("the fence {} has more than {} bytes", source, max_bytes));
    auto file = json::parse(geojson.begin(), geojson.end(), nullptr, false);
    if (file.is_discarded()) return ise::failure(ise::errc::malformed, fmt::format("the fence {} is not JSON", source));
    fence_reader reader;
    reader.read(file);
    if (reader.problem.empty() && reader.areas.empty()) reader.problem = "it has no area";
    if (!reader.problem.empty())
        return ise::failure(ise::errc::malformed, fmt::format("the fence {}: {}", source, reader.problem));
    geofence made;
    made.areas_ = std::move(reader.areas);
    return made;
}

} // namespace atirma
