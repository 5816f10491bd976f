// The boat keeps within its fence and off the coast, whatever it was told, and keeps no heading for ever.
#include <components/boat/mission_checksum.hpp>
#include <components/boat_simulator/simulated_boat.hpp>

#include <support/catch.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <random>

namespace guard_test {

using namespace atirma;
using namespace atirma::simulator;
using namespace std::chrono_literals;

namespace {

/// A square around the start, so many metres to each side.
std::shared_ptr<const sea_limits> square(waypoint middle, double half_m) {
    local_chart chart(middle);
    std::string ring;
    for (auto corner : {vec{-half_m, -half_m}, vec{half_m, -half_m}, vec{half_m, half_m}, vec{-half_m, half_m},
                        vec{-half_m, -half_m}}) {
        auto at = chart.to_waypoint(corner);
        ring += fmt::format("{}[{},{}]", ring.empty() ? "" : ",", at.longitude_deg, at.latitude_deg);
    }
    auto text = R"({"type":"Polygon","coordinates":[[)" + ring + "]]}";
    return std::make_shared<const sea_limits>(geofence::parse(text, "test").value(), false);
}

const waypoint open_sea{28.3, -15.7};

struct guarded_boat {
    explicit guarded_boat(std::shared_ptr<const sea_limits> limits, double wind_from_deg = 45,
                          waypoint start = open_sea, std::optional<double> heading_deg = std::nullopt)
        : boat(options(std::move(limits), start, heading_deg), constant_wind({7, wind_from_deg})) {}
    static boat_options options(std::shared_ptr<const sea_limits> limits, waypoint start,
                                std::optional<double> heading_deg) {
        boat_options made;
        made.limits = std::move(limits);
        made.start = start;
        made.heading_deg = heading_deg;
        made.epoch = utc_time(1'500'000'000'000ms);
        return made;
    }
    acknowledgement tell(boat_command what) {
        telecommand c;
        c.id = ++id;
        c.command = std::move(what);
        return boat.execute(c);
    }
    void sail(std::chrono::seconds more) {
        for (auto until = now + more; now < until;) {
            now += 1s;
            boat.advance(now);
            for (auto& raw : boat.take_packets(link_id::xbee)) {
                auto parsed = parse_telemetry(raw);
                if (!parsed) continue;
                if (const auto* n = std::get_if<navigation>(&parsed->body)) last = *n;
                if (const auto* text = std::get_if<notice>(&parsed->body)) notices.push_back(text->text);
            }
            nearest_m = std::min(nearest_m, clearance());
        }
    }
    double clearance() const {
        auto at = boat.location_now();
        return boat_limits->clearance_m({at.latitude_deg, at.longitude_deg}, 5000);
    }
    bool said(const std::string& part) const {
        return std::any_of(notices.begin(), notices.end(), [&](auto& n) { return n.find(part) != std::string::npos; });
    }

    simulated_boat boat;
    std::shared_ptr<const sea_limits> boat_limits;
    std::uint32_t id = 0;
    std::chrono::seconds now{};
    navigation last;
    std::vector<std::string> notices;
    double nearest_m = 5000;
};

} // namespace

TEST_CASE("guard: no heading leads the boat over its fence, in any wind") {
    std::mt19937 random(21);
    for (int run = 0; run < 16; ++run) {
        auto wind_from = static_cast<double>(random() % 360), heading = static_cast<double>(random() % 360);
        auto limits = square(open_sea, 400);
        guarded_boat it(limits, wind_from, open_sea, heading);
        it.boat_limits = limits;
        it.tell(commands::set_mode{sailing_mode::hold});
        it.sail(900s);
        INFO("wind from " << wind_from << ", heading " << heading << ", nearest " << it.nearest_m << " m");
        CHECK(it.nearest_m > 0);
        if (it.nearest_m > boat_guard::margin_m) continue; // too slow to get there: in irons or on the wind
        CHECK(it.last.at_fence);
        CHECK(it.last.mode == sailing_mode::station_keep);
        CHECK(it.said("turned back at its fence"));
    }
}

TEST_CASE(
    "guard: a waypoint outside the fence is refused with the reason, and with its fence off the boat goes there") {
    auto limits = square(open_sea, 400);
    guarded_boat it(limits);
    it.boat_limits = limits;
    local_chart chart(open_sea);
    auto outside = chart.to_waypoint({900, 0});
    auto no = it.tell(commands::waypoint_add{outside});
    CHECK(no.code == ack_code::refused);
    CHECK(no.text == "outside the fence; parameter fence 0 allows it");
    CHECK(it.tell(commands::waypoint_add{chart.to_waypoint({370, 0})}).text.find("it turns back at 60 m") !=
          std::string::npos);
    CHECK(it.tell(commands::waypoint_add{chart.to_waypoint({200, 0})}).code == ack_code::done);
    // So is a whole list, which is uploaded in parts.
    const auto before = it.boat.pilot().list().size();
    const std::vector<waypoint> list{chart.to_waypoint({100, 0}), outside};
    for (std::uint8_t i = 0; i < 2; ++i) it.tell(commands::mission_stage{i, list[i]});
    CHECK(it.tell(commands::mission_switch{2, mission_checksum(list)}).text.find("outside the fence") !=
          std::string::npos);
    CHECK(it.boat.pilot().list().size() == before);
    CHECK(it.tell(commands::set_parameter{parameter_id::fence, 0}).code == ack_code::done);
    CHECK(it.tell(commands::waypoint_insert{0, outside}).code == ack_code::done);
    it.tell(commands::waypoint_select{0});
    it.sail(1800s);
    CHECK(it.nearest_m < -100);
    CHECK_FALSE(it.last.at_fence);
    CHECK(it.said("fence off"));
    // On again, outside: it comes back by itself.
    it.tell(commands::set_parameter{parameter_id::fence, 1});
    it.sail(2400s);
    CHECK(it.last.at_fence);
    CHECK(it.clearance() > 0);
}

TEST_CASE("guard: a list from before the fence does not lead the boat out, and a mode ends the stay") {
    auto limits = square(open_sea, 400);
    auto options = guarded_boat::options(limits, open_sea, std::nullopt);
    options.course = {local_chart(open_sea).to_waypoint({1500, 0}), local_chart(open_sea).to_waypoint({1500, 300})};
    simulated_boat boat(options, constant_wind({7, 0}));
    boat.advance(1500s);
    CHECK(boat.navigation_now().at_fence);
    CHECK(boat.navigation_now().mode == sailing_mode::station_keep);
    auto at = boat.location_now();
    CHECK(limits->clearance_m({at.latitude_deg, at.longitude_deg}, 5000) > 0);
    telecommand c;
    c.id = 1;
    c.command = commands::set_mode{sailing_mode::return_home};
    boat.execute(c);
    CHECK_FALSE(boat.navigation_now().at_fence);
    boat.advance(2400s);
    CHECK_FALSE(boat.navigation_now().at_fence);
}

TEST_CASE("guard: the boat turns back before the coast") {
    auto coast = sea_limits::coast_only();
    guarded_boat it(coast, 0, {28.1530, -15.4480}, 90); // towards El Confital, on a reach
    it.boat_limits = coast;
    it.tell(commands::set_mode{sailing_mode::hold});
    it.tell(commands::set_parameter{parameter_id::heading_time_limit, 7200});
    it.sail(3600s);
    INFO("nearest " << it.nearest_m);
    CHECK(it.nearest_m > 0);
    CHECK(it.nearest_m < boat_guard::margin_m + 1);
    CHECK(it.last.at_fence);
    CHECK(it.said("before the coast"));
}

TEST_CASE("guard: a heading, and Manual without a remote control, end in Loiter") {
    for (auto mode : {sailing_mode::hold, sailing_mode::manual}) {
        guarded_boat it(nullptr, 0, open_sea, 90);
        it.boat_limits = sea_limits::coast_only();
        it.tell(commands::set_parameter{parameter_id::heading_time_limit, 120});
        it.tell(commands::set_mode{mode});
        it.sail(100s);
        CHECK(it.last.mode == mode);
        it.tell(commands::set_mode{mode}); // renewed
        it.sail(100s);
        CHECK(it.last.mode == mode);
        it.sail(30s);
        CHECK(it.last.mode == sailing_mode::station_keep);
        CHECK(it.said("loiters"));
        CHECK_FALSE(it.last.at_fence);
    }
}

} // namespace guard_test
