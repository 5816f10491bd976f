#include <components/gui_client/mission.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace atirma::console {
namespace {
constexpr double radians = std::numbers::pi / 180;
constexpr double earth_m = 6371000;
constexpr double on_air_deg = 2e-7; // two steps of the format
} // namespace

double distance_m(const waypoint& a, const waypoint& b) noexcept {
    double north = std::sin((b.latitude_deg - a.latitude_deg) * radians / 2),
           east = std::sin((b.longitude_deg - a.longitude_deg) * radians / 2);
    double h = north * north + std::cos(a.latitude_deg * radians) * std::cos(b.latitude_deg * radians) * east * east;
    return 2 * earth_m * std::asin(std::min(1.0, std::sqrt(h)));
}

double bearing_deg(const waypoint& a, const waypoint& b) noexcept {
    double east = (b.longitude_deg - a.longitude_deg) * radians;
    double y = std::sin(east) * std::cos(b.latitude_deg * radians);
    double x = std::cos(a.latitude_deg * radians) * std::sin(b.latitude_deg * radians) -
               std::sin(a.latitude_deg * radians) * std::cos(b.latitude_deg * radians) * std::cos(east);
    double degrees = std::atan2(y, x) / radians;
    return degrees < 0 ? degrees + 360 : degrees;
}

bool lies_on_leg(const waypoint& from, const waypoint& to, const waypoint& boat, float cross_track_error_m) noexcept {
    constexpr double tolerance_m = 40; // place and error come in different packets
    double off = (bearing_deg(from, boat) - bearing_deg(from, to)) * radians;
    double across = distance_m(from, boat) * std::sin(off);
    return std::abs(across - static_cast<double>(cross_track_error_m)) <= tolerance_m;
}

std::vector<mission_difference> compare(const std::vector<waypoint>& on_boat, const std::vector<waypoint>& here) {
    std::vector<mission_difference> all(std::max(on_boat.size(), here.size()));
    for (std::size_t i = 0; i < all.size(); ++i) {
        if (i >= on_boat.size()) {
            all[i].what = difference::only_here;
        } else if (i >= here.size()) {
            all[i].what = difference::only_on_boat;
        } else if (std::abs(on_boat[i].latitude_deg - here[i].latitude_deg) > on_air_deg ||
                   std::abs(on_boat[i].longitude_deg - here[i].longitude_deg) > on_air_deg) {
            all[i].what = difference::moved;
            all[i].moved_m = distance_m(on_boat[i], here[i]);
        }
    }
    return all;
}

bool same(const std::vector<waypoint>& on_boat, const std::vector<waypoint>& here) {
    auto all = compare(on_boat, here);
    return std::all_of(all.begin(), all.end(), [](const auto& one) { return one.what == difference::same; });
}

std::string describe_differences(const std::vector<waypoint>& on_boat, const std::vector<waypoint>& here) {
    auto all = compare(on_boat, here);
    auto moved = std::count_if(all.begin(), all.end(), [](const auto& one) { return one.what == difference::moved; });
    std::string text;
    if (on_boat.size() != here.size())
        text = fmt::format("the boat has {}, the list here has {}", on_boat.size(), here.size());
    if (moved > 0) text += fmt::format("{}{} {}", text.empty() ? "" : "; ", moved, moved == 1 ? "differs" : "differ");
    return text.empty() ? "no difference" : text;
}

bool mission_parts::take(std::uint16_t boot, const waypoints& part, utc_time measured_at, utc_time now) {
    bool other = boot != boot_ || part.revision != view_.revision || part.count != view_.count;
    bool late = view_.told_at && measured_at < newest_;
    if (other && late) return false;
    if (other) parts_.clear();
    boot_ = boot;
    auto was_complete = view_.complete;
    view_.revision = part.revision;
    if (!late) view_.active = part.active;
    newest_ = std::max(newest_, measured_at);
    view_.count = part.count;
    for (std::size_t i = 0; i < part.entries.size() && part.first + i < part.count; ++i)
        parts_[part.first + i] = entry{part.entries[i], now};
    view_.complete = parts_.size() == part.count;
    view_.points.clear();
    view_.told_at = now;
    if (view_.complete)
        for (const auto& [index, one] : parts_) {
            view_.points.push_back(one.at);
            view_.told_at = std::min(*view_.told_at, one.told_at);
        }
    return view_.complete || was_complete;
}

} // namespace atirma::console
