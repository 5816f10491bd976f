#include "packets.hpp"

#include <components/gui_client/choose_link.hpp>
#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <support/catch.hpp>

namespace state_test {

using namespace console_test;

TEST_CASE("console: what comes late over a slow link never moves the current position backwards, and is in the track") {
    console_state state;
    talker boat;
    auto old = boat.say(at(28.10, -15.40), t0, link_id::iridium);
    auto recent = boat.say(at(28.15, -15.45), t0 + 60s);
    state.on_telemetry(xbee_path, recent, t0 + 61s);
    state.on_telemetry(iridium_path, old, t0 + 120s);
    auto view = state.view(t0 + 121s);
    REQUIRE(view->boat.position);
    CHECK(view->boat.position->value.latitude_deg == Approx(28.15));
    CHECK(view->boat.position->link == link_id::xbee);
    REQUIRE(view->track->size() == 2);
    CHECK(view->track->front().latitude_deg == Approx(28.10));
    CHECK(view->track->front().link == link_id::iridium);
}

TEST_CASE("console: history fills the track and is never the current position") {
    console_state state;
    talker boat;
    auto history = boat.say(at(28.2, -15.5), t0 + 5s, link_id::gprs);
    history.history = true;
    state.on_telemetry(gprs_path, history, t0 + 60s);
    auto view = state.view(t0 + 61s);
    CHECK_FALSE(view->boat.position);
    REQUIRE(view->track->size() == 1);
    CHECK(view->track->front().history);
}

TEST_CASE("console: a packet that comes over two links counts on both and is taken once") {
    console_state state;
    talker boat;
    auto packet = boat.say(at(28.15, -15.45), t0);
    state.on_telemetry(xbee_path, packet, t0 + 1s);
    packet.link = link_id::gprs;
    state.on_telemetry(gprs_path, packet, t0 + 3s);
    auto view = state.view(t0 + 4s);
    REQUIRE(view->links.size() == 2);
    CHECK(view->links[0].path == gprs_path);
    CHECK(view->links[0].packets == 1);
    CHECK(view->links[0].duplicates == 1);
    CHECK(view->links[1].duplicates == 0);
    CHECK(view->boat.position->link == link_id::xbee);
    CHECK(view->track->size() == 1);
    CHECK(view->packets->size() == 2);
    CHECK(view->packets->back()->duplicate);
}

TEST_CASE("console: the last packet that comes again with a new subscription is no sign of life") {
    console_state state;
    talker boat;
    auto packet = boat.say(at(28.15, -15.45), t0);
    state.on_telemetry(xbee_path, packet, t0 + 1s);
    state.on_telemetry(xbee_path, packet, t0 + 500s);
    state.on_time(t0 + 501s);
    auto view = state.view(t0 + 501s);
    CHECK(*view->boat.last_heard == t0 + 1s);
    CHECK(view->links[0].packets == 1);
    REQUIRE(find(view->alarms, "no_data"));
    CHECK(find(view->alarms, "no_data")->how == severity::critical);
}

TEST_CASE("console: a location without a fix keeps the last place, and calls the operator") {
    console_state state;
    talker boat;
    state.on_telemetry(xbee_path, boat.say(at(28.15, -15.45), t0), t0 + 1s);
    auto blind = at(0, 0);
    blind.quality = fix_quality::none;
    state.on_telemetry(xbee_path, boat.say(blind, t0 + 2s), t0 + 3s);
    state.on_time(t0 + 3s);
    auto view = state.view(t0 + 3s);
    CHECK(view->boat.position->value.latitude_deg == Approx(28.15));
    CHECK_FALSE(view->boat.has_fix);
    CHECK(find(view->alarms, "fix"));
    state.on_telemetry(xbee_path, boat.say(at(28.16, -15.45), t0 + 4s), t0 + 5s);
    state.on_time(t0 + 5s);
    CHECK(find(state.view(t0 + 5s)->alarms, "fix")->over_at);
}

TEST_CASE("console: what is malformed is counted and kept for the inspector") {
    console_state state;
    talker boat;
    auto packet = boat.say(at(28.15, -15.45), t0);
    packet.raw[20] ^= std::byte{0xFF};
    state.on_telemetry(xbee_path, packet, t0 + 1s);
    auto view = state.view(t0 + 1s);
    CHECK(view->links[0].malformed == 1);
    CHECK_FALSE(view->boat.position);
    REQUIRE(view->packets->size() == 1);
    auto text = describe(view->packets->front()->packet);
    CHECK(text.kind == "malformed");
    CHECK(text.fields.back().value.find("checksum") != std::string::npos);
}

TEST_CASE("console: packets, track, notices and proxies are bounded") {
    state_options few;
    few.max_packets = 10;
    few.max_track = 20;
    few.max_notices = 3;
    few.max_links = 2;
    console_state state(few);
    talker boat;
    for (int i = 0; i < 100; ++i) {
        state.on_telemetry(xbee_path, boat.say(at(28 + i * 1e-4, -15.45), t0 + i * 1s), t0 + i * 1s);
        state.on_telemetry(xbee_path, boat.say(notice{"gust"}, t0 + i * 1s), t0 + i * 1s);
        state.on_telemetry("atirma/shore/n" + std::to_string(i), boat.say(notice{"gust"}, t0 + i * 1s), t0 + i * 1s);
    }
    auto view = state.view(t0 + 100s);
    CHECK(view->packets->size() == 10);
    CHECK(view->packets->back()->number == 201); // 100 proxies came, one had room beside the first
    CHECK(view->track->size() <= 20);
    CHECK(view->track->front().at == t0);
    CHECK(view->track->back().at == t0 + 99s);
    CHECK(view->track_bytes >=
          2 * view->track->size() * sizeof(atirma::console::track_point)); // where it is kept, and for who shows it
    CHECK(view->track_bytes <= 3 * 21 * sizeof(atirma::console::track_point));
    CHECK(view->boat.notices.size() == 3);
    CHECK(view->links.size() == 2);
}

TEST_CASE("console: a snapshot shares what has not changed, and stays as it was") {
    console_state state;
    talker boat;
    state.on_telemetry(xbee_path, boat.say(at(28.15, -15.45), t0), t0 + 1s);
    auto first = state.view(t0 + 1s);
    auto second = state.view(t0 + 2s);
    CHECK(first->track == second->track);
    CHECK(first->packets == second->packets);
    state.on_telemetry(xbee_path, boat.say(at(28.16, -15.45), t0 + 2s), t0 + 3s);
    CHECK(first->track->size() == 1);
    CHECK(state.view(t0 + 3s)->track->size() == 2);
    CHECK(second->number == first->number + 1);
}

TEST_CASE("console: freshness follows the period of the link") {
    boat_view boat;
    CHECK(freshness_of(boat.position, value_kind::position, boat, t0) == freshness::none);
    boat.position = heard<location>{at(28, -15), t0, t0, link_id::xbee, 1};
    CHECK(freshness_of(boat.position, value_kind::position, boat, t0 + 6s) == freshness::fresh);
    CHECK(freshness_of(boat.position, value_kind::position, boat, t0 + 20s) == freshness::ageing);
    CHECK(freshness_of(boat.position, value_kind::position, boat, t0 + 31s) == freshness::stale);
    boat.position->link = link_id::iridium;
    CHECK(freshness_of(boat.position, value_kind::position, boat, t0 + 25min) == freshness::fresh);
    configuration slow;
    slow.telemetry_period_s = {60, 0, 0};
    boat.rhythm.on_configuration(slow);
    boat.position->link = link_id::xbee;
    CHECK(freshness_of(boat.position, value_kind::position, boat, t0 + 100s) == freshness::fresh);
    CHECK(age_s(t0, t0 + 5s) == 0); // the boat's clock is ahead
    CHECK(age_text(0.4) == "now");
    CHECK(age_text(119) == "119 s");
    CHECK(age_text(7500) == "2 h 05");
}

TEST_CASE("console: the time to the waypoint counts what is made good towards it") {
    boat_view boat;
    CHECK_FALSE(time_to_waypoint_s(boat));
    auto here = at(28, -15);
    here.speed_over_ground_mps = 2;
    here.course_over_ground_deg = 90;
    navigation to;
    to.waypoint_count = 2;
    to.distance_to_waypoint_m = 400;
    to.bearing_to_waypoint_deg = 30;
    boat.position = heard<location>{here, t0, t0, link_id::xbee, 1};
    boat.sailing = heard<navigation>{to, t0, t0, link_id::xbee, 1};
    CHECK(*time_to_waypoint_s(boat) == Approx(400));
    boat.sailing->value.bearing_to_waypoint_deg = 270;
    CHECK_FALSE(time_to_waypoint_s(boat));
}

TEST_CASE("console: the cheapest link that works is chosen for a command") {
    std::map<std::string, link_view> links;
    CHECK(choose_link(links, {}, t0).empty());
    auto add = [&](const std::string& path, link_id id) -> link_view& {
        auto& made = links[path];
        made.path = path;
        made.link = id;
        made.connected = made.takes_commands = true;
        made.last_heard = t0;
        return made;
    };
    auto& iridium = add(iridium_path, link_id::iridium);
    CHECK(choose_link(links, {}, t0 + 10s) == iridium_path);
    auto& xbee = add(xbee_path, link_id::xbee);
    CHECK(choose_link(links, {}, t0 + 10s) == xbee_path);
    CHECK(choose_link(links, {}, t0 + 10min) == iridium_path); // the radio was not heard for long
    iridium.connected = false;
    CHECK(choose_link(links, {}, t0 + 10min) == xbee_path);
    iridium.connected = true;
    xbee.xbee = xbee_local();
    xbee.xbee->trouble = "the port is gone";
    CHECK(choose_link(links, {}, t0 + 10s) == iridium_path);
    iridium.takes_commands = false;
    CHECK(choose_link(links, {}, t0 + 10s) == xbee_path);
}

} // namespace state_test
