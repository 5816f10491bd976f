#include <components/boat/duplicate_filter.hpp>
#include <components/boat/newest_by_kind.hpp>
#include <components/boat/telecommand_tracker.hpp>

#include <ise/packet/json.hpp>

#include <support/catch.hpp>

namespace telecommand_tracker_test {

using namespace std::chrono_literals;
using namespace atirma;

namespace {

struct desk {
    telecommand_tracker book;
    ise::time_point now{1h};
    utc_time wall{std::chrono::hours(400'000)};

    explicit desk(link_policy policy = link_policy()) : book(policy) {}
    tracker_time at() const {
        tracker_time made;
        made.now = now;
        made.wall = wall;
        return made;
    }
    void pass(ise::duration time) {
        now += time;
        wall += std::chrono::duration_cast<std::chrono::milliseconds>(time);
    }
    std::uint32_t ask(std::uint32_t id, command_kind kind = command_kind::ping, float valid_s = 300) {
        telecommand_request request;
        request.id = id;
        request.command = boat_command(kind);
        request.valid_s = valid_s;
        return book.submit(at(), request, 77).value();
    }
    std::optional<telecommand_tracker::due> due() { return book.next_due(at()); }
    void outcome(std::uint32_t id, link_outcome::kind what) { book.on_outcome(at(), id, make_outcome(what, "text")); }
    telecommand_stage stage(std::uint32_t id) { return status_of(*book.find(id), link_id::xbee).state; }
    bool acknowledge(std::uint32_t id, command_kind kind = command_kind::ping) {
        acknowledgement ack;
        ack.id = id;
        ack.kind = kind;
        return book.on_acknowledgement(at(), ack);
    }
};

} // namespace

TEST_CASE(
    "telecommand tracker: a telecommand goes from queued over sent to acknowledged, and each change is told once") {
    desk it;
    auto asked_at = it.wall;
    it.ask(5, command_kind::tack_now);
    it.pass(3s);
    auto first = it.due();
    REQUIRE(first);
    auto command = parse_telecommand(first->raw);
    REQUIRE(command);
    CHECK(command->id == 5);
    CHECK(command->command == boat_command(commands::tack_now()));
    CHECK_FALSE(it.due());
    it.outcome(5, link_outcome::kind::delivered);
    CHECK(it.stage(5) == telecommand_stage::sent);
    CHECK(it.acknowledge(5, command_kind::tack_now));
    CHECK_FALSE(it.acknowledge(5, command_kind::tack_now));
    std::vector<telecommand_status> result;
    for (const auto& each : it.book.take_changes()) result.push_back(status_of(each, link_id::xbee));
    REQUIRE(result.size() == 3);
    for (const auto& each : result) CHECK(each.asked_at == asked_at); // whoever comes later is told no 1970
    CHECK(result[2].at == asked_at + 3s);
    CHECK(result[0].state == telecommand_stage::queued);
    CHECK(result[1].state == telecommand_stage::sent);
    CHECK(result[2].state == telecommand_stage::acknowledged);
    CHECK(it.book.take_changes().empty());
    CHECK(it.book.next_event() == ise::time_point::max());
}

TEST_CASE("telecommand tracker: without an answer it is sent again until its time is over, with pauses that grow") {
    desk it;
    it.ask(6, command_kind::ping, 100);
    std::vector<ise::duration> at;
    auto begun = it.now;
    while (!is_final(it.stage(6))) {
        if (it.due()) {
            at.push_back(it.now - begun);
            it.outcome(6, link_outcome::kind::later);
        }
        REQUIRE(it.book.next_event() > it.now);
        it.pass(it.book.next_event() - it.now);
        it.book.on_time(it.at());
    }
    CHECK(it.stage(6) == telecommand_stage::expired);
    CHECK(it.now - begun == 100s);
    CHECK(at == std::vector<ise::duration>{0s, 2s, 6s, 14s, 30s, 62s});
    CHECK(it.book.open_count() == 0);
}

TEST_CASE("telecommand tracker: what the boat has answered over another link is called back, and not sent any more") {
    desk it;
    it.ask(5);
    it.ask(6);
    REQUIRE(it.due());
    it.outcome(5, link_outcome::kind::delivered);
    CHECK(it.book.recall(it.at(), 5, "acknowledged over xbee"));
    CHECK(it.stage(5) == telecommand_stage::expired); // it may have arrived here as well
    CHECK(it.book.recall(it.at(), 6, "acknowledged over xbee"));
    CHECK(it.stage(6) == telecommand_stage::failed); // it never left
    CHECK_FALSE(it.book.recall(it.at(), 5, "again"));
    CHECK_FALSE(it.book.recall(it.at(), 7, "nobody knows it"));
    it.pass(1h);
    CHECK_FALSE(it.due());
    CHECK(it.acknowledge(5)); // the boat's word is the last one
    CHECK(it.stage(5) == telecommand_stage::acknowledged);
}

TEST_CASE(
    "telecommand tracker: a newer telecommand takes the place of open ones of its kind, where only the newest counts") {
    desk it;
    auto give = [&](std::uint32_t id, boat_command command, std::uint32_t authority = 0) {
        telecommand_request request;
        request.id = id;
        request.command = command;
        request.authority = authority;
        request.valid_s = 300;
        it.book.submit(it.at(), request, 77).value();
        it.book.replace_older(it.at(), id);
    };
    give(1, commands::set_mode{sailing_mode::return_home});
    REQUIRE(it.due());
    it.outcome(1, link_outcome::kind::delivered); // and lost on the air
    give(2, commands::tack_now());
    give(3, commands::set_mode{sailing_mode::station_keep});
    CHECK(it.stage(1) == telecommand_stage::expired);
    CHECK_THAT(it.book.find(1)->text, ise_test::Contains("replaced by telecommand 3"));
    CHECK(it.stage(2) == telecommand_stage::queued);
    give(4, commands::set_mode{sailing_mode::hold});
    CHECK(it.stage(3) == telecommand_stage::failed); // it never left
    it.pass(1min);
    for (auto next = it.due(); next; next = it.due()) CHECK(next->id != 1);
    // Each of these counts by itself: a list in parts, other parameters, bytes for the controller.
    desk other;
    std::swap(it, other);
    for (std::uint8_t i = 0; i < 3; ++i) give(10 + i, commands::mission_stage{i, {28.1, -15.4}});
    give(13, commands::set_parameter{parameter_id::fence, 0});
    give(14, commands::set_parameter{parameter_id::leeway_compensation, 1});
    give(15, commands::raw{"a"});
    give(16, commands::raw{"b"});
    CHECK(it.book.open_count() == 7);
    give(17, commands::set_parameter{parameter_id::fence, 1});
    CHECK(it.stage(13) == telecommand_stage::failed);
    CHECK(it.stage(14) == telecommand_stage::queued);
    // Somebody without the authority replaces nothing.
    give(20, commands::set_mode{sailing_mode::hold}, 4);
    give(21, commands::set_mode{sailing_mode::automatic}, 0);
    CHECK(it.stage(20) == telecommand_stage::queued);
}

TEST_CASE(
    "telecommand tracker: those that need no authority leave room for those that steer, and what saves has its own") {
    link_policy few;
    few.max_open = 4;
    desk it(few);
    auto asked = [&](std::uint32_t id, boat_command command) {
        telecommand_request request;
        request.id = id;
        request.command = command;
        auto taken = it.book.submit(it.at(), request, 0);
        if (!taken) CHECK(taken.error().code() == ise::errc::overloaded);
        return taken.has_value();
    };
    CHECK(asked(1, commands::ping()));
    CHECK(asked(2, commands::request_status()));
    CHECK_FALSE(asked(3, commands::ping()));
    CHECK(asked(4, commands::waypoint_delete{0}));
    CHECK(asked(5, commands::waypoint_delete{1}));
    CHECK_FALSE(asked(6, commands::waypoint_delete{2}));
    CHECK(asked(7, commands::set_mode{sailing_mode::station_keep}));
    CHECK(asked(8, commands::emergency_beacon{true}));
}

TEST_CASE("telecommand tracker: what may have left the shore never becomes queued again") {
    desk it;
    it.ask(8);
    REQUIRE(it.due());
    it.outcome(8, link_outcome::kind::unknown);
    CHECK(it.stage(8) == telecommand_stage::sent);
    it.pass(10s);
    REQUIRE(it.due());
    it.outcome(8, link_outcome::kind::later);
    CHECK(it.stage(8) == telecommand_stage::sent);
}

TEST_CASE("telecommand tracker: an answer that comes after the time is over corrects what was said") {
    desk it;
    it.ask(9, command_kind::ping, 1);
    REQUIRE(it.due());
    it.pass(2s);
    it.book.on_time(it.at());
    CHECK(it.stage(9) == telecommand_stage::expired);
    CHECK(it.acknowledge(9));
    CHECK(it.stage(9) == telecommand_stage::acknowledged);
    it.outcome(9, link_outcome::kind::delivered); // the link's word comes last
    CHECK(it.stage(9) == telecommand_stage::acknowledged);
    CHECK(it.book.open_count() == 0);
}

TEST_CASE("telecommand tracker: it is bounded in what is open and in what is remembered") {
    link_policy few;
    few.max_open = 3;
    few.max_remembered = 2;
    desk it(few);
    for (std::uint32_t id = 1; id <= 3; ++id) it.ask(id, command_kind::reboot);
    telecommand_request more;
    more.id = 4;
    auto refused = it.book.submit(it.at(), more, 0);
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == ise::errc::overloaded);
    for (std::uint32_t id = 1; id <= 3; ++id) CHECK(it.acknowledge(id, command_kind::reboot));
    CHECK(it.book.find(1) == nullptr);
    CHECK(it.book.find(3) != nullptr);
    it.ask(4);
    CHECK(it.book.open_count() == 1);
}

TEST_CASE("telecommand tracker: acknowledgements of nobody, and of another kind, change nothing") {
    desk it;
    it.ask(5, command_kind::tack_now);
    CHECK_FALSE(it.acknowledge(6));
    CHECK_FALSE(it.acknowledge(5, command_kind::reboot));
    CHECK(it.stage(5) == telecommand_stage::queued);
}

TEST_CASE("telecommand tracker: a request without an id gets the one that was chosen for it") {
    desk it;
    CHECK(it.ask(0) == 77);
}

TEST_CASE("a telecommand reads naturally as JSON") {
    auto request = ise::from_json<telecommand_request>(R"({"id":7,"command":{"kind":"set_mode","mode":"hold"}})");
    CHECK(request.id == 7);
    CHECK(request.command == boat_command(commands::set_mode{sailing_mode::hold}));
    CHECK_FALSE(request.valid_s); // by kind and link
    auto add = ise::from_json<telecommand_request>(
        R"({"command":{"kind":"waypoint_add","point":{"latitude_deg":28.15,"longitude_deg":-15.45}}})");
    CHECK(add.command == boat_command(commands::waypoint_add{{28.15, -15.45}}));
    CHECK_THROWS_WITH(ise::from_json<telecommand_request>(R"({"command":{"kind":"set_mode","mode":"fly"}})"),
                      ise_test::Contains("command.mode"));
}

TEST_CASE("duplicates are told by boot and sequence, in any order, within a bounded window") {
    duplicate_filter seen;
    const ise::bytes raw{std::byte{1}, std::byte{2}, std::byte{3}}, forged{std::byte{1}, std::byte{2}, std::byte{4}};
    CHECK(seen.first_time(1, 10, raw));
    CHECK_FALSE(seen.first_time(1, 10, raw));
    CHECK(seen.first_time(1, 12, raw));
    CHECK(seen.first_time(1, 11, raw)); // overtaken
    CHECK_FALSE(seen.first_time(1, 11, raw));
    CHECK(seen.first_time(2, 10, raw)); // another life of the boat
    CHECK(seen.first_time(1, 12 + duplicate_filter::window, raw));
    CHECK_FALSE(seen.first_time(1, 12 + duplicate_filter::window, raw));
    CHECK(seen.first_time(1, 13, raw)); // just inside the window, and new
    CHECK_FALSE(seen.first_time(1, 13, raw));
    CHECK(seen.first_time(1, 0xFFFFFFFF, raw));
    CHECK_FALSE(seen.first_time(1, 0xFFFFFFFF, raw));
    for (std::uint16_t boot = 10; boot < 10 + duplicate_filter::max_boots; ++boot) CHECK(seen.first_time(boot, 1, raw));
    CHECK(seen.first_time(2, 10, raw));    // long forgotten
    CHECK(seen.first_time(2, 11, forged)); // before the boat comes to that number
    CHECK(seen.first_time(2, 11, raw));
    CHECK_FALSE(seen.first_time(2, 11, raw));
}

TEST_CASE("a duplicate filter's window belongs to all boots, and history cannot take it from the present") {
    duplicate_filter seen;
    const ise::bytes raw{std::byte{1}, std::byte{2}};
    constexpr auto half = duplicate_filter::window / 2;
    for (std::uint32_t i = 0; i < half; ++i) REQUIRE(seen.first_time(9, i, raw));
    for (std::uint32_t i = 0; i < 4 * half; ++i) REQUIRE(seen.first_time(8, i, raw)); // of the boot before
    for (std::uint32_t i = 0; i < half; ++i) REQUIRE_FALSE(seen.first_time(9, i, raw));
    CHECK_FALSE(seen.first_time(8, 4 * half - 1, raw)); // the newest of it are known
    CHECK(seen.first_time(8, 0, raw));                  // the oldest are not
    CHECK_FALSE(seen.first_time(9, half - 1, raw));
}

TEST_CASE("telecommand tracker: the epoch of authority travels, and the boat's refusal tells the one that holds") {
    desk it;
    telecommand_request request;
    request.id = 8;
    request.authority = 5;
    request.command = commands::tack_now();
    it.book.submit(it.at(), request, 1).value();
    CHECK(parse_telecommand(it.due()->raw)->authority == 5);
    it.outcome(8, link_outcome::kind::later);
    request.authority = 7; // the same telecommand, asked for again by who has taken the authority anew
    CHECK(it.book.submit(it.at(), request, 1).value() == 8);
    it.pass(5s);
    CHECK(parse_telecommand(it.due()->raw)->authority == 7);
    acknowledgement no;
    no.id = 8;
    no.kind = command_kind::tack_now;
    no.code = ack_code::no_authority;
    no.authority = 16'777'217; // 2^24 + 1: no float holds it
    CHECK(it.book.on_acknowledgement(it.at(), no));
    CHECK(it.book.find(8)->result == ack_code::no_authority);
    CHECK(it.book.find(8)->boat_obeys == 16'777'217u);
}

TEST_CASE("telecommand tracker: an answer to what was sent under authority names its epoch, another one is nobody's") {
    desk it;
    telecommand_request request;
    request.authority = 6;
    auto send = [&](std::uint32_t id, command_kind kind) {
        request.id = id;
        request.command = boat_command(kind);
        it.book.submit(it.at(), request, 1).value();
        REQUIRE(it.due());
        it.outcome(id, link_outcome::kind::delivered);
    };
    auto answer = [&](std::uint32_t id, command_kind kind, std::optional<std::uint32_t> epoch,
                      ack_code code = ack_code::done) {
        acknowledgement ack;
        ack.id = id;
        ack.kind = kind;
        ack.code = code;
        ack.authority = epoch;
        return it.book.on_acknowledgement(it.at(), ack);
    };
    send(8, command_kind::tack_now);
    for (auto code : {ack_code::done, ack_code::refused, ack_code::unknown_command})
        for (std::optional<std::uint32_t> forged : {std::optional<std::uint32_t>(), {0u}, {4u}, {8u}, {0xFFFFFFFFu}})
            CHECK_FALSE(answer(8, command_kind::tack_now, forged, code));
    CHECK(it.stage(8) == telecommand_stage::sent);
    CHECK_FALSE(it.book.find(8)->boat_obeys);
    request.authority = 8; // asked for again while it is under way: the boat answers what it got
    it.book.submit(it.at(), request, 1).value();
    CHECK(answer(8, command_kind::tack_now, 6));
    CHECK(it.stage(8) == telecommand_stage::acknowledged);
    // The boat refuses under its own epoch, and answers questions under any.
    send(9, command_kind::tack_now);
    CHECK(answer(9, command_kind::tack_now, 12, ack_code::no_authority));
    send(10, command_kind::ping);
    CHECK_FALSE(answer(10, command_kind::ping, {}));
    CHECK(answer(10, command_kind::ping, 12));
    // Nor does an answer need an epoch where none was sent.
    request.authority = 0;
    send(11, command_kind::tack_now);
    CHECK(answer(11, command_kind::tack_now, {}));
}

TEST_CASE("newest by kind: what comes late over a slower link is history, each kind by itself") {
    newest_by_kind it;
    utc_time at{std::chrono::hours(400'000)};
    auto packet = [&](std::uint8_t kind, std::chrono::seconds later, std::chrono::seconds received = 0s) {
        telemetry_packet made;
        made.measured_at = at + later;
        made.received_at = at + (received > 0s ? received : later);
        made.raw = {std::byte{1}, std::byte{kind}};
        return made;
    };
    CHECK_FALSE(it.is_history(packet(1, 10s)));
    CHECK_FALSE(it.is_history(packet(1, 10s))); // the same over another link
    CHECK(it.is_history(packet(1, 9s)));
    CHECK_FALSE(it.is_history(packet(3, 9s)));
    auto said = packet(1, 20s);
    said.history = true;
    CHECK(it.is_history(said));
    CHECK_FALSE(it.is_history(packet(1, 11s)));
    CHECK_FALSE(it.is_history(packet(1, 1000000s, 30s))); // a clock that is days ahead, or four minutes
    CHECK_FALSE(it.is_history(packet(1, 31s + 4min, 31s)));
    CHECK_FALSE(it.is_history(packet(1, 32s))); // makes nothing history that is measured after it came
    CHECK(it.is_history(packet(1, 30s, 33s)));
}

TEST_CASE("telecommand tracker: what a link has in its hand when the validity ends may have been executed") {
    desk it;
    it.ask(1, command_kind::ping, 10);
    it.ask(2, command_kind::ping, 10);
    REQUIRE(it.due()->id == 1);
    it.pass(10s);
    it.book.on_time(it.at());
    CHECK_THAT(it.book.find(1)->text, ise_test::Contains("may have been executed"));
    CHECK_THAT(it.book.find(2)->text, ise_test::Contains("before it could be sent"));
}

TEST_CASE("telecommand tracker: the default validity is by kind and link, and the earlier of two ends counts") {
    telecommand_request request;
    request.command = commands::tack_now();
    utc_time now(std::chrono::hours(400'000));
    CHECK(validity_of(request, now, link_id::xbee) == 30s);
    CHECK(validity_of(request, now, link_id::iridium) == 900s);
    request.command = commands::set_mode{sailing_mode::hold};
    CHECK(validity_of(request, now, link_id::gprs) == 60s);
    request.valid_s = 20;
    CHECK(validity_of(request, now, link_id::gprs) == 20s);
    request.valid_until = now + 5s;
    CHECK(validity_of(request, now, link_id::gprs) == 5s);
    request.valid_s.reset();
    request.valid_until = now + 2h;
    CHECK(validity_of(request, now, link_id::gprs) == 2h);
    request.valid_until = now + 48h;
    CHECK(validity_of(request, now, link_id::gprs) == 24h);
    request.valid_until = now;
    CHECK_FALSE(validity_of(request, now, link_id::gprs));
    desk it;
    request.valid_until = it.wall - 1s;
    auto refused = it.book.submit(it.at(), request, 77);
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), ise_test::Contains("its validity ended at"));
    CHECK(it.book.open_count() == 0);
}

TEST_CASE("telecommand tracker: each attempt says how long it is still valid") {
    desk it;
    it.ask(5, command_kind::tack_now, 60);
    auto first = parse_telecommand(it.due()->raw).value();
    CHECK(first.valid_for == 60s);
    CHECK(first.sent_at == it.wall);
    CHECK(first.clock_of == 0);
    it.outcome(5, link_outcome::kind::delivered);
    it.pass(16s);
    auto again = it.due();
    REQUIRE(again);
    CHECK(parse_telecommand(again->raw)->valid_for == 44s);
    CHECK(again->remaining == 44s);
    CHECK(status_of(*it.book.find(5), link_id::xbee).valid_until == it.wall + 44s);
}

TEST_CASE(
    "telecommand tracker: a boat that finds late what is not gets it again by its own clock, three times at most") {
    desk it;
    it.ask(5, command_kind::tack_now, 60);
    packet_header header;
    header.boot = 9;
    auto expired = [&] {
        acknowledgement ack;
        header.measured_at = it.wall - 4min; // as its clock shows
        ack.header = header;
        ack.id = 5;
        ack.kind = command_kind::tack_now;
        ack.code = ack_code::expired;
        ack.text = "its clock is not set by GPS, and UTC was given";
        return it.book.on_acknowledgement(it.at(), ack);
    };
    for (int i = 0; i < 3; ++i) {
        auto sent = it.due();
        REQUIRE(sent);
        auto parsed = parse_telecommand(sent->raw).value();
        CHECK(parsed.clock_of == (i == 0 ? 0 : 9));
        if (i > 0) CHECK(parsed.sent_at <= it.wall - 4min);
        it.outcome(5, link_outcome::kind::delivered);
        it.pass(1s);
        CHECK(expired());
        CHECK(it.stage(5) == telecommand_stage::sent);
    }
    REQUIRE(it.due());
    it.outcome(5, link_outcome::kind::delivered);
    CHECK(expired());
    CHECK(it.stage(5) == telecommand_stage::acknowledged);
    CHECK(it.book.find(5)->result == ack_code::expired);
    CHECK_FALSE(it.book.find(5)->executed_at);
}

TEST_CASE("telecommand tracker: it says when the boat executed what it answers") {
    desk it;
    it.ask(5, command_kind::tack_now, 600);
    REQUIRE(it.due());
    it.outcome(5, link_outcome::kind::delivered);
    it.pass(100s);
    acknowledgement ack;
    ack.header.boot = 3;
    ack.header.measured_at = it.wall - 40s; // the answer was long on its way
    ack.id = 5;
    ack.kind = command_kind::tack_now;
    CHECK(it.book.on_acknowledgement(it.at(), ack));
    CHECK(status_of(*it.book.find(5), link_id::xbee).executed_at == it.wall - 40s);
}

} // namespace telecommand_tracker_test
