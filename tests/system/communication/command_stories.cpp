#include "shore.hpp"

#include <components/boat/recall.hpp>

#include <support/catch.hpp>

using namespace communication_test;
using ise_test::Contains;
using enum authority_action;

namespace {

struct crewed : shore {
    explicit crewed(std::uint64_t seed = 1, bool raw_telecommands = false) : shore(seed) {
        terms.raw_telecommands = raw_telecommands;
        start_node(one);
        start_node(two);
        REQUIRE(
            until([&] { return serves(one) && serves(two) && state(one).peer_lives && state(two).peer_lives; }, 30s));
        seen = &listen();
        sends_every_second({link_id::xbee});
        REQUIRE(until([&] { return seen->heard.size() >= 3; }, 30s));
    }
    // The command's way as everybody is told it.
    std::vector<telecommand_status> told_of(std::uint32_t id) const {
        std::vector<telecommand_status> made;
        for (const auto& one : seen->states)
            if (one.id == id) made.push_back(one);
        return made;
    }
    void link_up(link_id link, bool up) { boat.over(link).up = up; }
    std::size_t waypoints() const { return boat.boat.pilot().list().size(); }
    listener* seen = nullptr;
};

telecommand_request of_kind(std::uint32_t id, command_kind kind) {
    telecommand_request made;
    made.id = id;
    made.command = boat_command(kind);
    return made;
}

} // namespace

TEST_CASE(
    "communication: an operator takes the authority, commands the boat, and everybody sees it and can read it later") {
    crewed it;
    auto no = it.command("ana", adds_waypoint(5));
    REQUIRE_FALSE(no);
    CHECK(no.error().code() == ise::errc::refused);
    CHECK_THAT(no.error().message(), Contains("nobody holds the authority") && Contains("action take"));
    auto taken = it.authority("ana", take);
    REQUIRE(taken);
    CHECK(taken->holder == "test/ana");
    CHECK(taken->epoch == 2);
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 2; }, 10s)); // the boat is told without being asked
    auto done = it.command("ana", adds_waypoint(5));
    REQUIRE(done);
    CHECK(done->state == telecommand_stage::acknowledged);
    CHECK(done->result == ack_code::done);
    CHECK(it.waypoints() == 1);
    CHECK(it.boat.epochs.back() == 2);
    REQUIRE(it.until([&] { return !it.told_of(5).empty() && is_final(it.told_of(5).back().state); }, 5s));
    auto outcome = it.told_of(5);
    CHECK(outcome.front().state == telecommand_stage::queued);
    CHECK(outcome.back().asked_by == "test/ana");
    CHECK(outcome.back().link == link_id::xbee);
    CHECK(outcome.back().authority == 2);
    CHECK(outcome.back().command == adds_waypoint(5).command);
    // The same again is the same; another under its number is not.
    CHECK(it.command("ana", adds_waypoint(5))->state == telecommand_stage::acknowledged);
    auto other = it.command("ana", adds_waypoint(5, 28.17));
    REQUIRE_FALSE(other);
    CHECK_THAT(other.error().message(),
               Contains("waypoint_add already, asked for by test/ana") && Contains("choose another id"));
    CHECK(it.boat.executed[5] == 1);
    // On record, at both nodes.
    for (const auto& node : {one, two}) {
        auto page = it.ask("bea", services::telecommand_record, record_request(), 10s, node);
        REQUIRE(page);
        REQUIRE(page->entries.size() == 2); // and the ping that told the boat
        CHECK(page->entries[0].id == 5);
        CHECK(page->entries[0].asked_by == "test/ana");
        CHECK(page->entries[0].result == ack_code::done);
        CHECK(page->entries[1].kind == command_kind::ping);
        REQUIRE(page->authority.size() == 1);
        CHECK(page->authority[0].how == "taken by test/ana");
    }
    record_request too_many;
    too_many.max_entries = 501;
    CHECK_THAT(it.ask("bea", services::telecommand_record, too_many).error().message(), Contains("1 to 500"));
}

TEST_CASE(
    "communication: of two operators one commands, the other asks, gets it handed over, and the first is refused") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    auto no = it.command("bea", adds_waypoint(5));
    REQUIRE_FALSE(no);
    CHECK_THAT(no.error().message(),
               Contains("test/ana holds the authority") && Contains("not test/bea") && Contains("action ask"));
    // Who only asks needs none.
    CHECK(it.command("bea", of_kind(6, command_kind::ping))->state == telecommand_stage::acknowledged);
    REQUIRE(it.authority("bea", ask));
    REQUIRE(it.until(
        [&] {
            return !it.seen->authorities.empty() &&
                   it.seen->authorities.back().asked_by == std::vector<std::string>{"test/bea"};
        },
        5s));
    auto refused = it.authority("bea", take);
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), Contains("test/ana holds"));
    auto handed = it.authority("ana", hand_over, false, "test/bea");
    REQUIRE(handed);
    CHECK(handed->epoch == 4);
    CHECK(it.command("bea", adds_waypoint(7))->result == ack_code::done);
    CHECK_THAT(it.command("ana", adds_waypoint(8)).error().message(), Contains("test/bea holds"));
    REQUIRE(it.until([&] { return it.seen->authorities.back().holder == "test/bea"; }, 5s));
    CHECK(it.boat.epochs == std::vector<std::uint32_t>{4});
    CHECK(it.waypoints() == 1);
    REQUIRE(it.authority("bea", release));
    CHECK_THAT(it.command("bea", adds_waypoint(9)).error().message(), Contains("nobody holds"));
}

TEST_CASE("communication: what can lose the boat is sent only when it is confirmed") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    auto manual = of_kind(5, command_kind::set_mode); // manual is its mode unless told otherwise
    for (auto request : {of_kind(4, command_kind::reboot), manual, of_kind(6, command_kind::waypoint_clear),
                         of_kind(7, command_kind::emergency_beacon)}) {
        auto no = it.command("ana", request);
        REQUIRE_FALSE(no);
        CHECK(no.error().code() == ise::errc::refused);
        CHECK_THAT(no.error().message(), Contains("confirmed true"));
    }
    manual.confirmed = true;
    CHECK(it.command("ana", manual)->result == ack_code::done);
    CHECK(it.boat.boat.pilot().mode() == sailing_mode::manual);
}

TEST_CASE("communication: the newest fix says that the second controller sent it, and its link is no way to the boat") {
    crewed it;
    REQUIRE(it.until([&] { return it.state(one).fix.has_value(); }, 10s));
    CHECK_FALSE(it.state(one).fix->beacon);
    auto now = std::chrono::floor<std::chrono::milliseconds>(it.world.wall_start + it.world.elapsed());
    location where;
    where.quality = fix_quality::gps;
    where.latitude_deg = 28.2;
    where.longitude_deg = -15.5;
    telemetry_packet packet;
    packet.link = link_id::iridium;
    packet.boot = beacon_boot;
    packet.sequence = 9;
    packet.measured_at = packet.received_at = now + 1min; // newer than what the boat sends meanwhile
    packet.received_at += 1s;
    packet.raw = encode_telemetry({packet.boot, packet.sequence, packet.measured_at}, where);
    keep_request keep;
    keep.packets = {packet};
    auto kept = it.ask("proxy", services::telemetry_store, keep);
    REQUIRE(kept);
    CHECK(kept->copies == 2);
    REQUIRE(it.until([&] { return it.state(one).fix->beacon; }, 10s));
    CHECK(it.state(one).fix->latitude_deg == Approx(28.2));
    for (const auto& link : it.state(one).links) CHECK(link.alive == (link.link == link_id::xbee));
}

TEST_CASE("communication: raw telecommands are off, then need their service, the authority and a confirmation, and are "
          "on record") {
    telecommand_request raw;
    raw.id = 4;
    raw.command = commands::raw{"hex:0A1B"};
    auto ask = [&](crewed& it) { return it.ask("ana", services::raw_telecommand, raw); };
    crewed without;
    REQUIRE(without.authority("ana", take));
    raw.confirmed = true;
    auto off = ask(without);
    REQUIRE_FALSE(off);
    CHECK_THAT(off.error().message(), Contains("raw telecommands are off at shore/one (--raw-telecommands)"));

    crewed it(1, true);
    auto wrong_service = it.command("ana", raw);
    REQUIRE_FALSE(wrong_service);
    CHECK_THAT(wrong_service.error().message(), Contains("goes to the service raw_telecommand"));
    CHECK_THAT(it.ask("ana", services::raw_telecommand, of_kind(5, command_kind::ping)).error().message(),
               Contains("ping is no raw telecommand"));
    CHECK_THAT(ask(it).error().message(), Contains("nobody holds the authority"));
    REQUIRE(it.authority("ana", take));
    raw.confirmed = false;
    CHECK_THAT(ask(it).error().message(), Contains("raw is dangerous") && Contains("confirmed true"));
    raw.confirmed = true;
    auto long_one = raw;
    long_one.command = commands::raw{std::string(65, 'x')};
    CHECK_THAT(it.ask("ana", services::raw_telecommand, long_one).error().message(), Contains("64 fit a frame"));
    auto refused = ask(it);
    REQUIRE(refused);
    CHECK(refused->result == ack_code::refused);
    CHECK(refused->text == "raw telecommands are off aboard (--raw-telecommands)");
    auto page = it.ask("ana", services::telecommand_record, record_request());
    REQUIRE(page);
    REQUIRE_FALSE(page->entries.empty());
    auto entry = std::ranges::find(page->entries, 4u, &telecommand_status::id);
    REQUIRE(entry != page->entries.end());
    CHECK(entry->command == raw.command);
    CHECK(entry->asked_by == "test/ana");
    CHECK(entry->result == ack_code::refused);
}

TEST_CASE("communication: the authority outlives the nodes, and goes on at the other one") {
    crewed it;
    auto epoch = it.authority("ana", take)->epoch;
    it.crash(one);
    it.world.run_for(5s);
    auto looked = it.authority("bea", look);
    REQUIRE(looked);
    CHECK(looked->holder == "test/ana");
    CHECK(looked->epoch == epoch);
    CHECK(it.command("ana", adds_waypoint(5))->result == ack_code::done);
    CHECK_FALSE(it.authority("bea", take));
    auto forced = it.authority("bea", take, true);
    REQUIRE(forced);
    CHECK(forced->epoch == 3); // odd: of the secondary
    it.crash(two);
    it.world.run_for(5s);
    it.start_node(one);
    it.start_node(two);
    REQUIRE(it.until(
        [&] {
            return it.serves(one) && it.state(one).authority.holder == "test/bea" && it.state(two).authority.epoch == 3;
        },
        30s));
    CHECK_THAT(it.command("ana", adds_waypoint(6)).error().message(), Contains("test/bea holds"));
    CHECK(it.command("bea", adds_waypoint(6))->result == ack_code::done);
    CHECK(it.boat.epochs == std::vector<std::uint32_t>{2, 3});
}

TEST_CASE("communication: where the nodes are cut off from each other the boat obeys the higher epoch, and the other "
          "holder is told") {
    crewed it;
    REQUIRE(it.authority("ana", take, false, {}, one));
    it.world.net().partition("one", "two");
    it.world.run_for(5s);
    auto forced = it.authority("bea", take, true, {}, two);
    REQUIRE(forced);
    CHECK(forced->epoch == 3);
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 3; }, 10s));
    auto stale = it.command("ana", adds_waypoint(5), 20s, one); // here ana still holds it
    REQUIRE(stale);
    CHECK(stale->result == ack_code::no_authority);
    CHECK(stale->boat_obeys == 3u);
    CHECK(it.waypoints() == 0);
    auto outcome = it.command("ana", adds_waypoint(6), 20s, one);
    REQUIRE_FALSE(outcome);
    CHECK_THAT(outcome.error().message(), Contains("the boat obeys epoch 3") && Contains("take it again"));
    CHECK(it.command("bea", adds_waypoint(7), 20s, two)->result == ack_code::done);
    it.world.net().heal("one", "two");
    REQUIRE(it.until([&] { return it.state(one).authority.holder == "test/bea"; }, 30s));
    CHECK_THAT(it.command("ana", adds_waypoint(8), 20s, one).error().message(), Contains("test/bea holds"));
    it.world.run_for(5s);
    for (const auto& node : {one, two}) {
        auto page = it.ask("ana", services::telecommand_record, record_request(), 10s, node);
        REQUIRE(page);
        CHECK(std::ranges::count_if(page->entries, [](const auto& entry) {
                  return entry.id == 5 && entry.result == ack_code::no_authority;
              }) == 1);
        CHECK(std::ranges::count_if(page->entries, [](const auto& entry) {
                  return entry.id == 7 && entry.result == ack_code::done;
              }) == 1);
    }
}

TEST_CASE(
    "communication: forged epochs at the boat end with the operator's next take, also over a restart of both nodes") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 2; }, 10s));
    telecommand forged;
    forged.id = 900;
    forged.authority = 0xFFFFFFFF;
    it.boat.boat.execute(forged);
    CHECK(it.command("ana", adds_waypoint(5))->result == ack_code::done);
    forged.id = 901;
    forged.authority = 2 + simulator::simulated_boat::max_epoch_step; // as far as one packet goes
    it.boat.boat.execute(forged);
    CHECK(it.command("ana", adds_waypoint(6))->result == ack_code::no_authority);
    CHECK_THAT(it.command("ana", adds_waypoint(7)).error().message(),
               Contains("the boat obeys epoch 1026") && Contains("take it again"));
    auto anew = it.authority("ana", take);
    REQUIRE(anew);
    CHECK(anew->boat_epoch > 1026);
    CHECK(it.command("ana", adds_waypoint(8))->result == ack_code::done);
    it.crash(one);
    it.crash(two);
    it.start_node(one);
    it.start_node(two);
    REQUIRE(it.until([&] { return it.serves(one) && it.state(one).authority.boat_epoch == anew->boat_epoch; }, 30s));
    it.world.run_for(5s);
    CHECK(it.command("ana", adds_waypoint(9), 60s)->result == ack_code::done);
}

TEST_CASE("communication: a telecommand's validity ends in time where the clock goes back an hour over a restart") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 2; }, 10s));
    for (auto link : {link_id::xbee, link_id::gprs, link_id::iridium}) it.link_up(link, false);
    auto request = adds_waypoint(5);
    request.valid_s = 15;
    (void)it.command("ana", request, 2s); // no link: its answer comes later, if ever
    it.crash(one);
    it.crash(two);
    it.start_node(one);
    it.process(one).set_wall_offset(-1h);
    it.world.run_for(22s);
    auto page = it.ask("ana", services::telecommand_record, record_request(), 10s, one);
    REQUIRE(page);
    auto entry = std::ranges::find_if(page->entries, [](const auto& each) { return each.id == 5; });
    REQUIRE(entry != page->entries.end());
    CHECK(entry->state == telecommand_stage::expired);
    for (auto link : {link_id::xbee, link_id::gprs, link_id::iridium}) it.link_up(link, true);
    it.world.run_for(60s);
    CHECK(it.boat.executed.count(5) == 0);
}

TEST_CASE("communication: an order that was lost on the air is not executed after a newer one") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 2; }, 10s));
    auto mode = [](std::uint32_t id, sailing_mode to) {
        telecommand_request made;
        made.id = id;
        made.command = commands::set_mode{to};
        return made;
    };
    it.boat.over(link_id::xbee).lose = 1;
    (void)it.command("ana", mode(101, sailing_mode::return_home), 1s);
    it.world.run_for(5s);
    auto newer = mode(102, sailing_mode::station_keep);
    SECTION("over the same link") {}
    SECTION("over another link") { newer.via = link_id::gprs; }
    SECTION("at the other node, as the first one dies") { it.crash(one); }
    auto hold = it.command("ana", newer);
    REQUIRE(hold);
    CHECK(hold->result == ack_code::done);
    it.world.run_for(60s);
    CHECK(it.boat.boat.pilot().mode() == sailing_mode::station_keep);
    auto page = it.ask("bea", services::telecommand_record, record_request());
    REQUIRE(page);
    auto entry = std::ranges::find(page->entries, 101u, &telecommand_status::id);
    REQUIRE(entry != page->entries.end());
    CHECK(entry->state == telecommand_stage::expired);
    CHECK_THAT(entry->text, Contains("replaced by telecommand 102") && Contains("may have been executed"));
    REQUIRE_FALSE(it.told_of(101).empty());
    CHECK(it.told_of(101).back().text == entry->text);
}

TEST_CASE("communication: what was called back is not given again to a proxy that was started anew") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 2; }, 10s));
    for (auto link : {link_id::xbee, link_id::gprs, link_id::iridium}) it.link_up(link, false);
    auto request = adds_waypoint(5);
    request.via = link_id::xbee;
    request.valid_s = 300;
    (void)it.command("ana", request, 2s);
    it.world.run_for(20s);
    it.crash("shore/xbee");
    it.world.run_for(2s);
    recall_request back;
    back.id = 5;
    auto reply = it.ask("ana", services::telecommand_recall, back);
    REQUIRE(reply);
    CHECK_FALSE(reply->recalled);
    SECTION("the node goes on") {}
    SECTION("the node is started anew, too") {
        it.crash(one);
        it.world.run_for(5s);
        it.start_node(one);
    }
    it.start_proxy(link_id::xbee);
    it.world.run_for(20s);
    for (auto link : {link_id::xbee, link_id::gprs, link_id::iridium}) it.link_up(link, true);
    it.world.run_for(60s);
    CHECK(it.boat.executed.count(5) == 0);
    reply = it.ask("ana", services::telecommand_recall, back);
    REQUIRE(reply);
    CHECK(reply->state == telecommand_stage::expired);
    CHECK_THAT(reply->text, Contains("called back (by test/ana)") && Contains("may have been executed"));
}

TEST_CASE("communication: pings of somebody without the authority keep nobody from commanding the boat") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 2; }, 10s));
    it.link_up(link_id::iridium, false);
    for (std::uint32_t i = 0; i < 64; ++i) {
        auto ping = of_kind(1000 + i, command_kind::ping);
        ping.via = link_id::iridium;
        ping.valid_s = 86400;
        (void)it.command("eve", ping, 200ms);
    }
    CHECK(it.command("ana", adds_waypoint(5))->result == ack_code::done);
    REQUIRE(it.authority("bea", take, true));
    CHECK(it.until([&] { return it.boat.boat.authority() == 4; }, 10s)); // the epoch is announced all the same
}

TEST_CASE("communication: a link that is dead does not count as alive in a node that was started anew") {
    crewed it;
    auto xbee = [&](const std::string& node) {
        auto links = it.state(node).links;
        return *std::ranges::find(links, link_id::xbee, &link_health::link);
    };
    it.link_up(link_id::xbee, false);
    it.world.run_for(60s);
    REQUIRE_FALSE(xbee(two).alive);
    it.crash(one);
    it.world.run_for(5s);
    it.start_node(one);
    REQUIRE(it.until([&] { return it.serves(one) && xbee(one).packets > 0; }, 30s)); // the last packet is repeated
    CHECK(xbee(one).reached);
    CHECK_FALSE(xbee(one).alive);
    CHECK(xbee(one).last_heard == xbee(two).last_heard);
}

TEST_CASE("communication: a telecommand takes the link that was chosen, or the best one that is alive") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 2; }, 10s));
    auto by_iridium = adds_waypoint(5);
    by_iridium.via = link_id::iridium;
    CHECK(it.command("ana", by_iridium)->result == ack_code::done);
    CHECK(it.boat.over(link_id::iridium).commands == 1);
    auto xbee = it.boat.over(link_id::xbee).commands;
    CHECK(it.command("ana", adds_waypoint(6))->result == ack_code::done);
    CHECK(it.boat.over(link_id::xbee).commands == xbee + 1);
    it.link_up(link_id::xbee, false);
    it.sends_every_second({link_id::gprs});
    it.world.run_for(40s); // over the radio the boat is not heard any more
    CHECK(it.command("ana", adds_waypoint(7))->result == ack_code::done);
    CHECK(it.boat.over(link_id::gprs).commands == 1);
    REQUIRE(it.until([&] { return !it.told_of(7).empty() && is_final(it.told_of(7).back().state); }, 5s));
    CHECK(it.told_of(7).back().link == link_id::gprs);
}

TEST_CASE("communication: a link that does not deliver is joined by another, and the boat does it once") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 2; }, 10s));
    it.sends_every_second({link_id::gprs, link_id::xbee});
    it.world.run_for(5s);
    it.link_up(link_id::xbee, false); // just now: it still counts as alive
    auto request = adds_waypoint(5);
    request.valid_s = 200;
    auto answer = it.command("ana", request, 100s);
    REQUIRE(answer);
    CHECK(answer->result == ack_code::done);
    CHECK(it.boat.over(link_id::gprs).commands == 1);
    CHECK(it.told_of(5).back().link == link_id::gprs);
    auto radio = it.boat.over(link_id::xbee).commands;
    it.link_up(link_id::xbee, true); // where it waited as well, until the boat had answered
    it.world.run_for(150s);
    CHECK(it.boat.over(link_id::xbee).commands == radio);
    CHECK(it.boat.executed[5] == 1);
    CHECK(it.waypoints() == 1);
}

TEST_CASE("communication: what is under way when a node dies is carried on by the other, and done once") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 2; }, 10s));
    it.link_up(link_id::xbee, false);
    auto request = adds_waypoint(5);
    request.valid_s = 600;
    auto pending = it.command("ana", request, 3s);
    REQUIRE(pending);
    CHECK(pending->state == telecommand_stage::pending);
    it.crash(one);
    SECTION("the other takes it over") {}
    SECTION("the proxy dies too, and knows nothing any more") {
        it.crash("shore/xbee");
        it.world.run_for(10s);
        it.start_proxy(link_id::xbee);
    }
    it.world.run_for(10s);
    it.link_up(link_id::xbee, true);
    auto again = it.command("ana", request, 100s);
    CAPTURE(again->text, it.state(two).telecommands_open, it.boat.over(link_id::gprs).commands,
            it.boat.over(link_id::xbee).commands);
    REQUIRE(again);
    CHECK(again->state == telecommand_stage::acknowledged);
    it.start_node(one);
    it.world.run_for(20s);
    CHECK(it.boat.executed[5] == 1);
    auto page = it.ask("bea", services::telecommand_record, record_request(), 10s, one);
    REQUIRE(page);
    CHECK(page->entries[0].id == 5);
    CHECK(page->entries[0].state == telecommand_stage::acknowledged);
    CHECK(page->entries[0].asked_by == "test/ana");
}

TEST_CASE("communication: what was chosen for a link that only the dead node has is taken over, and expires") {
    shore it;
    it.start_node(one);
    std::erase_if(it.terms.proxies, [](const auto& proxy) { return proxy.link == link_id::iridium; });
    it.start_node(two);
    REQUIRE(it.until([&] { return it.serves(one) && it.serves(two) && it.state(two).peer_lives; }, 30s));
    REQUIRE(it.authority("ana", take));
    it.boat.over(link_id::iridium).up = false;
    auto request = adds_waypoint(5);
    request.via = link_id::iridium;
    request.valid_s = 60;
    REQUIRE(it.command("ana", request, 3s));
    REQUIRE(it.until([&] { return it.state(two).telecommands_open == it.state(one).telecommands_open; }, 10s));
    it.crash(one);
    auto again = it.command("ana", request, 100s);
    REQUIRE(again);
    CHECK(again->state == telecommand_stage::expired);
}

TEST_CASE("communication: a telecommand that no link takes waits within its validity, and is expired after it") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    for (auto link : {link_id::xbee, link_id::gprs, link_id::iridium}) it.crash("shore/" + std::string(name_of(link)));
    it.world.run_for(5s);
    auto request = adds_waypoint(5);
    request.valid_s = 20;
    auto late = it.command("ana", request, 60s);
    REQUIRE(late);
    CHECK(late->state == telecommand_stage::expired);
    CHECK_THAT(late->text, Contains("before it could be sent"));
    request.id = 6;
    request.valid_s = 120;
    CHECK(it.command("ana", request, 3s)->state == telecommand_stage::pending);
    it.start_proxy(link_id::gprs);
    CHECK(it.command("ana", request, 60s)->state == telecommand_stage::acknowledged);
    CHECK(it.boat.executed.contains(5) == false);
}

TEST_CASE("communication: what cannot be recorded is not sent") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    REQUIRE(it.until([&] { return it.boat.boat.authority() == 2; }, 10s));
    it.crash(two);
    it.world.run_for(10s);
    it.fill_disk(one, true);
    auto no = it.command("ana", adds_waypoint(5));
    REQUIRE_FALSE(no);
    CHECK_THAT(no.error().message(), Contains("cannot be recorded") && Contains("not sent"));
    auto stays = it.authority("bea", take, true);
    REQUIRE_FALSE(stays);
    CHECK_THAT(stays.error().message(), Contains("stays as it is"));
    it.fill_disk(one, false);
    CHECK(it.command("ana", adds_waypoint(5))->result == ack_code::done);
    CHECK(it.waypoints() == 1);
}

TEST_CASE("communication: wrong requests are refused with what is right") {
    crewed it;
    REQUIRE(it.authority("ana", take));
    auto bad = adds_waypoint(5);
    bad.valid_s = 0;
    CHECK_THAT(it.command("ana", bad).error().message(), Contains("valid_s is 1 to 86400"));
    bad = adds_waypoint(5, 95);
    CHECK_THAT(it.command("ana", bad).error().message(), Contains("not a place on the globe"));
    bad = adds_waypoint(5);
    bad.via = static_cast<link_id>(9);
    CHECK_THAT(it.command("ana", bad).error().message(), Contains("no proxy for") && Contains("xbee, gprs, iridium"));
    track_request page;
    page.max_packets = 0;
    CHECK_THAT(it.ask("ana", services::track, page).error().message(), Contains("1 to 1000"));
    page.max_packets = 5;
    for (std::uint64_t i = 1; i < 10; ++i) page.seen[i] = 1;
    CHECK_THAT(it.ask("ana", services::track, page).error().message(), Contains("9 stores"));
}
