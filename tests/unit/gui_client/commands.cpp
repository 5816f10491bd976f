#include "packets.hpp"

#include <components/gui_client/words.hpp>

#include <support/catch.hpp>

namespace commands_test {

using namespace console_test;

TEST_CASE("console: the log tells own commands from those of others") {
    console_state state;
    boat_command hold = commands::set_mode{sailing_mode::hold};
    state.asked(5, xbee_path, hold, t0);
    state.on_status(xbee_path, status(5, telecommand_stage::queued), t0 + 1s);
    state.on_status(xbee_path, status(9, telecommand_stage::sent), t0 + 2s);
    CHECK(state.view(t0)->links[0].open_commands == 2);
    state.on_status(xbee_path, status(5, telecommand_stage::acknowledged, ack_code::done, "hold"), t0 + 3s);
    auto all = *state.view(t0 + 3s)->commands;
    REQUIRE(all.size() == 2);
    CHECK(all[0].own);
    CHECK(all[0].what == "mode Heading");
    CHECK(all[0].phase == command_phase::done);
    CHECK_FALSE(all[1].own);
    CHECK(all[1].what == "set mode");
    CHECK(all[1].phase == command_phase::sent);
}

TEST_CASE("console: a proxy that tells of a command before its call returns makes no second entry") {
    console_state state;
    state.on_status(xbee_path, status(5, telecommand_stage::queued), t0);
    boat_command hold = commands::set_mode{sailing_mode::hold};
    state.asked(5, xbee_path, hold, t0 + 1s);
    auto all = *state.view(t0 + 1s)->commands;
    REQUIRE(all.size() == 1);
    CHECK(all[0].own);
    CHECK(all[0].phase == command_phase::queued);
}

TEST_CASE("console: what the boat answers is the last word, also after its time was over") {
    command_log log;
    log.on_status(xbee_path, status(5, telecommand_stage::expired), t0);
    CHECK(log.find(5)->phase == command_phase::expired);
    log.on_status(xbee_path, status(5, telecommand_stage::sent), t0 + 1s);
    CHECK(log.find(5)->phase == command_phase::expired);
    log.on_status(xbee_path, status(5, telecommand_stage::acknowledged, ack_code::refused, "no"), t0 + 2s);
    CHECK(log.find(5)->phase == command_phase::refused);
    log.on_outcome(5, command_phase::expired, std::nullopt, "late", t0 + 3s);
    CHECK(log.find(5)->phase == command_phase::refused);
    CHECK(log.find(5)->text == "no");
}

TEST_CASE("console: the log has the verified identity of who asked, where the node has verified one") {
    command_log log;
    auto info = status(5, telecommand_stage::sent);
    info.asked_as = "ise://atirma/operator/ana";
    log.on_status(xbee_path, info, t0);
    CHECK(log.find(5)->asked_as == "ise://atirma/operator/ana");
    log.on_status(xbee_path, status(5, telecommand_stage::acknowledged, ack_code::done), t0 + 1s); // of the proxy
    CHECK(log.find(5)->asked_as == "ise://atirma/operator/ana");
    log.on_status(xbee_path, status(6, telecommand_stage::sent), t0);
    CHECK(log.find(6)->asked_as.empty());
}

TEST_CASE("console: a link tells how it is sealed once its proxy has told") {
    link_view link;
    CHECK(link.seal() == nullptr);
    link.account.emplace();
    REQUIRE(link.seal());
    CHECK_FALSE(link.seal()->sealed);
    link.xbee.emplace();
    link.xbee->seal.sealed = true;
    CHECK(link.seal()->sealed);
}

TEST_CASE("console: the log is bounded and keeps what is still open") {
    command_log log(10);
    log.on_status(xbee_path, status(1, telecommand_stage::sent), t0);
    for (std::uint32_t id = 2; id < 50; ++id)
        log.on_status(xbee_path, status(id, telecommand_stage::acknowledged, ack_code::done), t0 + id * 1s);
    CHECK(log.entries()->size() == 10);
    CHECK(log.find(1));
    CHECK(log.find(49));
    CHECK_FALSE(log.find(2));
    CHECK(log.open(xbee_path) == 1);
}

TEST_CASE("console: a parameter is pending until the boat has answered, and says why it did not change") {
    console_state state;
    talker boat;
    configuration result;
    result.forbidden_angle_upwind_deg = 60;
    result.telemetry_period_s = {2, 0, 0};
    state.on_telemetry(xbee_path, boat.say(result, t0), t0);
    auto upwind = [&] {
        return state.view(t0)->parameters[static_cast<std::size_t>(parameter_id::forbidden_angle_upwind)];
    };
    CHECK(upwind().confirmed == 60.0f);
    state.asked(3, xbee_path, commands::set_parameter{parameter_id::forbidden_angle_upwind, 50}, t0 + 1s);
    CHECK(upwind().pending == 50.0f);
    CHECK(upwind().confirmed == 60.0f);
    state.on_outcome(3, command_phase::done, 50.0f, "", t0 + 4s);
    CHECK_FALSE(upwind().pending);
    CHECK(upwind().confirmed == 50.0f);
    state.asked(4, xbee_path, commands::set_parameter{parameter_id::forbidden_angle_upwind, 20}, t0 + 5s);
    state.on_outcome(4, command_phase::refused, 50.0f, "forbidden_angle_upwind is 30 to 85 deg, not 20", t0 + 8s);
    CHECK_FALSE(upwind().pending);
    CHECK(upwind().confirmed == 50.0f);
    CHECK(upwind().problem.find("30 to 85") != std::string::npos);
    REQUIRE(find(state.view(t0 + 8s)->alarms, "command:4"));
}

TEST_CASE("console: a list of waypoints is put together from its parts, and parts of two revisions do not mix") {
    mission_parts parts;
    waypoints first, second;
    first.revision = second.revision = 4;
    first.count = second.count = 3;
    first.entries = {{28.1, -15.1}, {28.2, -15.2}};
    second.first = 2;
    second.entries = {{28.3, -15.3}};
    parts.take(1, first, t0, t0);
    CHECK_FALSE(parts.view().complete);
    CHECK(parts.view().points.empty());
    parts.take(1, second, t0 + 5s, t0 + 5s);
    REQUIRE(parts.view().complete);
    CHECK(parts.view().points.size() == 3);
    CHECK(parts.complete_since(t0));
    CHECK_FALSE(parts.complete_since(t0 + 1s)); // its first part was told before
    parts.take(1, first, t0 + 6s, t0 + 6s);
    CHECK(parts.complete_since(t0 + 5s));
    second.revision = 5;
    parts.take(1, second, t0 + 7s, t0 + 7s);
    CHECK_FALSE(parts.view().complete);
    waypoints none;
    none.revision = 6;
    parts.take(1, none, t0 + 8s, t0 + 8s);
    CHECK(parts.view().complete);
    CHECK(parts.view().points.empty());
    CHECK(parts.complete_since(t0 + 8s));
}

TEST_CASE("console: a list of waypoints that comes late does not replace the newer one") {
    console_state state;
    talker boat;
    waypoints before, now;
    before.revision = 4;
    before.count = 1;
    before.active = 0;
    before.entries = {{28.1, -15.1}};
    now.revision = 5;
    now.count = 2;
    now.active = 1;
    now.entries = {{28.2, -15.2}, {28.3, -15.3}};
    auto late = boat.say(before, t0, link_id::iridium);
    state.on_telemetry(xbee_path, boat.say(now, t0 + 60s), t0 + 61s);
    state.on_telemetry(iridium_path, late, t0 + 90s);
    CHECK(state.mission().view().revision == 5);
    REQUIRE(state.mission().view().complete);
    CHECK(state.mission().view().points == now.entries);
    // A late part of the same list fills it, and does not set the active waypoint back.
    now.active = 0;
    auto part = boat.say(now, t0 + 30s, link_id::iridium);
    state.on_telemetry(iridium_path, part, t0 + 95s);
    CHECK(state.mission().view().active == 1);
    boat.boot = 8; // the boat has started again, with the list of before
    state.on_telemetry(xbee_path, boat.say(before, t0 + 100s), t0 + 101s);
    CHECK(state.mission().view().points == before.entries);
}

TEST_CASE("console: a boat sails the leg that its cross-track error belongs to, and none that it was sent away from") {
    waypoint from{28.1545, -15.4580}, to{28.1600, -15.4520}, beside{28.1573, -15.4548};
    CHECK(lies_on_leg(from, to, beside, 8));
    CHECK_FALSE(lies_on_leg(from, to, beside, -80));
    waypoint afar{28.1530, -15.4480}; // sent to `to` from here: it is on its line, and far from that leg
    CHECK_FALSE(lies_on_leg(from, to, afar, 1));
    CHECK(lies_on_leg(afar, to, afar, 0));
}

TEST_CASE("console: two lists are compared place by place") {
    std::vector<waypoint> on_boat{{28.1, -15.4}, {28.2, -15.5}}, here = on_boat;
    CHECK(same(on_boat, here));
    CHECK(describe_differences(on_boat, here) == "no difference");
    here[1].latitude_deg += 1e-7; // what one step on air is
    CHECK(same(on_boat, here));
    here[1].latitude_deg += 0.001;
    here.push_back({28.3, -15.6});
    auto all = compare(on_boat, here);
    REQUIRE(all.size() == 3);
    CHECK(all[0].what == difference::same);
    CHECK(all[1].what == difference::moved);
    CHECK(all[1].moved_m == Approx(111.2).margin(0.5));
    CHECK(all[2].what == difference::only_here);
    CHECK(compare(here, on_boat)[2].what == difference::only_on_boat);
    CHECK(describe_differences(on_boat, here) == "the boat has 2, the list here has 3; 1 differs");
    CHECK(bearing_deg({28, -15}, {29, -15}) == Approx(0).margin(1e-9));
    CHECK(bearing_deg({0, 0}, {0, 1}) == Approx(90));
    CHECK(bearing_deg({0, 0}, {0, -1}) == Approx(270));
}

TEST_CASE("console: the track is exported as CSV and GPX, in segments where nothing was told") {
    std::vector<track_point> track(3);
    track[0].at = t0;
    track[1].at = t0 + 2s;
    track[2].at = t0 + 20min;
    track[1].latitude_deg = 28.1234567;
    track[1].link = link_id::gprs;
    auto csv = track_to_csv(track);
    CHECK(csv.find("2026-09-21T14:13:22.000Z,28.1234567,0.0000000,0.00,gprs,0,0\n") != std::string::npos);
    auto gpx = track_to_gpx("A & B", track, {{28.1, -15.4}}, {});
    CHECK(gpx.find("<name>A &amp; B</name>") != std::string::npos);
    CHECK(gpx.find("<rtept lat=\"28.1000000\"") != std::string::npos);
    std::size_t segments = 0;
    for (auto from = gpx.find("<trkseg>"); from != std::string::npos; from = gpx.find("<trkseg>", from + 1)) ++segments;
    CHECK(segments == 2);
    CHECK(track_to_gpx("x", {}, {}, {}).find("<trkseg>") == std::string::npos);
}

TEST_CASE("console: a track over Iridium alone is one line, which an outage ends") {
    report_rhythm rhythm;
    std::vector<track_point> track;
    for (auto after : {0min, 30min, 60min, 90min, 300min, 330min}) {
        rhythm.on_report(link_id::iridium, t0 + after);
        track.push_back({});
        track.back().at = t0 + after;
        track.back().link = link_id::iridium;
    }
    auto gpx = track_to_gpx("x", track, {}, rhythm);
    CHECK(gpx.find("</trkseg>\n<trkseg>") == gpx.rfind("</trkseg>\n<trkseg>"));
    CHECK(gpx.find("</trkseg>\n<trkseg>") != std::string::npos);
}

TEST_CASE("console: commands and packets in words") {
    auto words = [](boat_command command) { return describe(command); };
    CHECK(words(commands::set_parameter{parameter_id::time_to_next_tack, 30}) == "time to next tack := 30 s");
    CHECK(words(commands::get_parameter{parameter_id::leeway_compensation}) == "get leeway compensation");
    CHECK(words(commands::set_mode{sailing_mode::automatic}) == "mode Auto");
    CHECK(words(commands::waypoint_insert{2, {28.153, -15.448}}) == "insert waypoint 3 at 28.15300, -15.44800");
    CHECK(words(commands::waypoint_select{0}) == "sail to waypoint 1");
    CHECK(words(commands::set_telemetry_period{link_id::iridium, 600}) == "telemetry over Iridium: 600 s");
    CHECK(words(commands::set_telemetry_period{link_id::xbee, 0}) == "telemetry over XBee: off");
    CHECK(words(commands::emergency_beacon{false}) == "beacon off");
    CHECK(words(commands::tack_now()) == "tack now");
    CHECK(danger(commands::set_parameter{parameter_id::time_to_next_tack, 30}).empty());
    CHECK_FALSE(danger(commands::reboot()).empty());
    CHECK(danger(commands::set_telemetry_period{link_id::xbee, 0}).find("over XBee until") != std::string::npos);
    talker boat;
    auto packet = boat.say(at(28.15, -15.45), t0);
    auto text = describe(packet);
    CHECK(text.kind == "location");
    bool found = false;
    for (const auto& field : text.fields) found = found || (field.name == "latitude" && field.value == "28.1500000 °");
    CHECK(found);
    auto hex = hex_dump(packet.raw);
    CHECK(hex.substr(0, 12) == "0000  01 01 ");
    CHECK(std::count(hex.begin(), hex.end(), '\n') == static_cast<long>((packet.raw.size() + 15) / 16));
    CHECK(hex_dump({}).empty());
}

TEST_CASE("console: a telecommand has its end, its execution, and says where the boat found it late") {
    console_state state;
    boat_command hold = commands::set_mode{sailing_mode::hold};
    state.asked(5, xbee_path, hold, t0, t0 + 60s);
    auto entry = [&] { return state.view(t0)->commands->front(); };
    CHECK(entry().valid_until == t0 + 60s);
    CHECK(entry().may_be_called_back());
    auto info = status(5, telecommand_stage::sent);
    info.valid_until = t0 + 58s; // as the node has it
    state.on_status(xbee_path, info, t0 + 1s);
    CHECK(entry().valid_until == t0 + 58s);
    CHECK_FALSE(entry().may_be_called_back());
    state.on_called_back(5, "it is on its way");
    CHECK(entry().called_back == "it is on its way");
    info = status(5, telecommand_stage::acknowledged, ack_code::done, "hold");
    info.executed_at = t0 + 30s;
    state.on_status(xbee_path, info, t0 + 40s);
    CHECK(entry().phase == command_phase::done);
    CHECK(entry().executed_at == t0 + 30s);
    state.on_status(xbee_path, status(6, telecommand_stage::acknowledged, ack_code::expired, "was valid until"), t0);
    CHECK(state.commands().find(6)->phase == command_phase::late);
    CHECK(name_of(command_phase::late) == "too late");
    CHECK(is_over(command_phase::late));
}

} // namespace commands_test
