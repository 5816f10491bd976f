#include <components/communication_node/command_router.hpp>
#include <components/communication_node/peer_watch.hpp>

#include <support/catch.hpp>

namespace command_desk_test {

using namespace atirma;
using namespace std::chrono_literals;
using ise_test::Contains;

namespace {

const std::string me = "shore/one";

struct table {
    command_router desk;
    link_table links{usual_links()};
    ise::time_point now{1h};
    utc_time wall{std::chrono::hours(400'000)};

    explicit table(desk_options options = desk_options()) : desk(options) {}
    void pass(ise::duration time) {
        now += time;
        wall += std::chrono::duration_cast<std::chrono::milliseconds>(time);
    }
    void there(link_id link, bool heard = true) {
        links.reached(link, true);
        if (heard) links.heard(link, now);
    }
    static telecommand_request request(std::uint32_t id, float valid_s = 300) {
        telecommand_request made;
        made.id = id;
        made.command = commands::tack_now();
        made.valid_s = valid_s;
        return made;
    }
    command_record begin(const telecommand_request& asked) {
        auto record = desk.prepare(now, wall, asked, 77, "ana", 4, me).value();
        REQUIRE(desk.know(now, wall, record, me));
        return record;
    }
    std::optional<command_router::give> give() { return desk.next_give(now, wall, links); }
    telecommand_status says(std::uint32_t id, telecommand_stage stage, std::string text = "") {
        telecommand_status made;
        made.id = id;
        made.kind = status(id).kind;
        made.state = stage;
        made.text = std::move(text);
        if (stage == telecommand_stage::acknowledged) made.result = ack_code::done;
        made.attempts = 1;
        return made;
    }
    const telecommand_status& status(std::uint32_t id) { return desk.find(id)->status; }
};

using enum link_id;

} // namespace

TEST_CASE("command desk: the best link that is alive gets a telecommand, and its answer is the end of it") {
    table it;
    it.there(iridium);
    it.there(gprs);
    it.links.reached(xbee, true); // its proxy answers, the boat was not heard over it
    it.begin(it.request(5));
    auto given = it.give();
    REQUIRE(given);
    CHECK(given->link == gprs);
    CHECK(given->request.id == 5);
    CHECK(given->request.authority == 4);
    CHECK(given->request.command.kind() == command_kind::tack_now);
    CHECK_FALSE(it.give());
    it.desk.on_status(it.wall, gprs, it.says(5, telecommand_stage::sent, "on the line"));
    CHECK(it.status(5).state == telecommand_stage::sent);
    it.desk.on_status(it.wall, gprs, it.says(5, telecommand_stage::acknowledged, "done"));
    CHECK(it.status(5).state == telecommand_stage::acknowledged);
    CHECK(it.status(5).link == gprs);
    CHECK(it.status(5).attempts == 1);
    CHECK(it.desk.open_count() == 0);
    auto result = it.desk.take_changes();
    REQUIRE(result.size() == 3);
    CHECK_THAT(result[0].status.text, Contains("given to gprs"));
    CHECK(result[2].status.asked_by == "ana");
    CHECK(result[2].status.at > result[1].status.at); // in order even within one millisecond
}

TEST_CASE(
    "command desk: a link that does not deliver is joined by the next one that is alive, once its patience is over") {
    table it;
    it.there(xbee);
    it.there(gprs);
    it.there(iridium, false);
    it.begin(it.request(5));
    CHECK(it.give()->link == xbee);
    it.pass(19s);
    CHECK_FALSE(it.give());
    it.pass(2s);
    auto second = it.give();
    REQUIRE(second);
    CHECK(second->link == gprs);
    CHECK(second->request.id == 5);
    CHECK(*second->request.valid_s == Approx(279));
    it.pass(31s);
    CHECK_FALSE(it.give()); // over Iridium nothing was heard: no use
    it.there(iridium);
    CHECK(it.give()->link == iridium);
    it.desk.on_status(it.wall, xbee, it.says(5, telecommand_stage::acknowledged));
    CHECK(it.status(5).link == xbee);
    it.desk.on_status(it.wall, iridium, it.says(5, telecommand_stage::expired));
    CHECK(it.status(5).state == telecommand_stage::acknowledged);
}

TEST_CASE("command desk: once one link has the answer, the others that still have it are called back") {
    table it;
    it.there(gprs);
    it.begin(it.request(5));
    REQUIRE(it.give()->link == gprs);
    it.pass(31s); // beyond its patience
    it.there(xbee);
    REQUIRE(it.give()->link == xbee);
    CHECK(it.desk.take_recalls().empty());
    it.desk.on_status(it.wall, xbee, it.says(5, telecommand_stage::acknowledged, "done"));
    auto recalls = it.desk.take_recalls();
    REQUIRE(recalls.size() == 1);
    CHECK(recalls[0].id == 5);
    CHECK(recalls[0].link == gprs);
    CHECK(recalls[0].why == "acknowledged over xbee");
    CHECK(it.desk.take_recalls().empty());
    // What the link says of it then changes nothing.
    it.desk.on_status(it.wall, gprs, it.says(5, telecommand_stage::expired, "called back"));
    CHECK(it.status(5).state == telecommand_stage::acknowledged);
    CHECK(it.desk.take_recalls().empty());
}

TEST_CASE("command desk: a link that was chosen is the only one, alive or not") {
    table it;
    it.there(xbee);
    auto asked = it.request(6);
    asked.via = iridium;
    it.begin(asked);
    CHECK(it.give()->link == iridium);
    it.pass(200s);
    CHECK_FALSE(it.give());
    it.desk.on_refused(it.now, it.wall, 6, iridium, "no credit");
    CHECK(it.status(6).state == telecommand_stage::failed);
    CHECK_THAT(it.status(6).text, Contains("iridium refuses it: no credit"));
}

TEST_CASE("command desk: a link that refuses makes way at once, and with no link at all a telecommand waits") {
    table it;
    it.begin(it.request(5, 60));
    CHECK_FALSE(it.give());
    CHECK(it.desk.next_event(it.now, it.links) <= it.now + 1s); // it looks again
    it.pass(10s);
    it.there(xbee, false);
    CHECK(it.give()->link == xbee);
    it.desk.on_refused(it.now, it.wall, 5, xbee, "64 telecommands wait");
    CHECK(it.status(5).state == telecommand_stage::queued);
    it.links.reached(gprs, true);
    CHECK(it.give()->link == gprs);
    it.pass(60s);
    it.desk.on_time(it.now, it.wall);
    CHECK(it.status(5).state == telecommand_stage::expired);
    CHECK_THAT(it.status(5).text, Contains("before it could be sent"));
    // A late answer corrects what was said.
    it.desk.on_status(it.wall, gprs, it.says(5, telecommand_stage::acknowledged));
    CHECK(it.status(5).state == telecommand_stage::acknowledged);
}

TEST_CASE("router: a link that refused a telecommand gets it again later, and one that cannot send it does not") {
    table it;
    it.there(iridium);
    it.begin(it.request(5));
    REQUIRE(it.give()->link == iridium);
    it.desk.on_given(5, iridium); // an earlier request to its proxy had no answer
    it.desk.on_refused(it.now, it.wall, 5, iridium, "the database is locked");
    CHECK_FALSE(it.give());
    CHECK(it.desk.next_event(it.now, it.links) <= it.now + 30s);
    it.pass(29s);
    CHECK_FALSE(it.give());
    it.pass(1s);
    auto again = it.give();
    REQUIRE(again);
    CHECK(again->link == iridium);
    CHECK(*again->request.valid_s == Approx(270));
    CHECK(it.status(5).text == "is given to iridium again");
    CHECK_FALSE(it.give());
    SECTION("it sends it then") {
        it.desk.on_status(it.wall, iridium, it.says(5, telecommand_stage::sent));
        CHECK(it.status(5).state == telecommand_stage::sent);
        it.pass(60s);
        CHECK_FALSE(it.give());
    }
    SECTION("it cannot send it") {
        it.desk.on_refused(it.now, it.wall, 5, iridium, "64 telecommands wait");
        it.desk.on_status(it.wall, iridium, it.says(5, telecommand_stage::failed, "too long"));
        it.pass(60s);
        CHECK_FALSE(it.give());
    }
    SECTION("another link has it meanwhile") {
        it.desk.on_refused(it.now, it.wall, 5, iridium, "64 telecommands wait");
        it.there(gprs);
        REQUIRE(it.give()->link == gprs);
        it.pass(29s);
        CHECK_FALSE(it.give());
        it.pass(2s); // beyond the patience of GPRS
        CHECK(it.give()->link == iridium);
    }
    SECTION("it is called back meanwhile") {
        it.desk.on_refused(it.now, it.wall, 5, iridium, "64 telecommands wait");
        CHECK(it.desk.call_back(it.wall, 5, "by ana").empty());
        CHECK(it.status(5).state == telecommand_stage::failed);
    }
    SECTION("its validity ends before the link answers") {
        it.pass(270s);
        it.desk.on_time(it.now, it.wall);
        CHECK_THAT(it.status(5).text, Contains("before it could be sent"));
    }
}

TEST_CASE("command desk: the other node's telecommands are left to it, until it is silent") {
    table it, other;
    it.there(xbee);
    auto asked = other.request(8);
    auto record = it.desk.prepare(it.now, it.wall, asked, 1, "bea", 2, "shore/two").value();
    REQUIRE(it.desk.know(it.now, it.wall, record, me));
    CHECK_FALSE(it.desk.know(it.now, it.wall, record, me)); // nothing new
    CHECK_FALSE(it.give());
    it.desk.on_status(it.wall, xbee, it.says(8, telecommand_stage::queued, "waits")); // the proxy tells everybody
    it.desk.take_over(it.now, it.wall, me);
    CHECK(it.give()->link == xbee);
    auto changed = it.desk.take_changes();
    REQUIRE(changed.size() == 3);
    CHECK_THAT(changed[2].status.text, Contains("given to xbee") && !Contains("too"));
    CHECK(changed[1].node == me);
    CHECK(changed[1].status.asked_by == "bea");
    // It comes back and tells what it knew: less than is known here.
    CHECK_FALSE(it.desk.know(it.now, it.wall, record, me));
    auto answered = record;
    answered.status.state = telecommand_stage::acknowledged;
    answered.status.at = it.wall - 1s;
    CHECK(it.desk.know(it.now, it.wall, answered, me)); // but the boat's answer is more
    CHECK(it.desk.open_count() == 0);
    CHECK(knows_more(answered, changed[2]));
    CHECK_FALSE(knows_more(changed[2], answered));
}

namespace {

/// How long a telecommand is still open.
std::chrono::seconds ends_after(table& it, std::uint32_t id) {
    std::chrono::seconds passed(0);
    for (; passed < 2min; ++passed) {
        it.desk.on_time(it.now + passed, it.wall + passed);
        if (is_final(it.status(id).state)) break;
    }
    return passed;
}

} // namespace

TEST_CASE("command desk: a validity ends in time over a restart, whatever the clocks do meanwhile") {
    table before;
    auto record = before.desk.prepare(before.now, before.wall, before.request(5, 15), 77, "ana", 4, me).value();
    auto expires_after = [&](ise::duration down, ise::duration set, ise::duration rebooted, const std::string& who) {
        table it;
        it.now = before.now + down - rebooted;
        it.wall = before.wall + std::chrono::duration_cast<std::chrono::milliseconds>(down + set);
        it.desk.know(it.now, it.wall, record, who);
        return ends_after(it, 5);
    };
    CHECK(expires_after(5s, 0s, 0s, me) == 10s);
    CHECK(expires_after(5s, -1h, 0s, me) == 10s); // an hour back
    CHECK(expires_after(20s, -1h, 0s, me) == 0s);
    CHECK(expires_after(5s, 1h, 0s, me) == 0s);                  // an hour ahead: too early rather than too late
    CHECK(expires_after(5s, 0s, 30min, me) == 10s);              // the machine has started anew, its clock is right
    CHECK(expires_after(5s, -1h, 30min, me) == 0s);              // and is not: nobody knows
    CHECK(expires_after(5s, -1h, 0s, "shore/two") <= 15s + 30s); // by another node's clock, which has 30 s of grace
}

TEST_CASE("command desk: one that was taken over ends in time over a restart, too") {
    table it;
    auto record = it.desk.prepare(it.now + 7min, it.wall, it.request(5, 15), 1, "bea", 2, "shore/two").value();
    REQUIRE(it.desk.know(it.now, it.wall, record, me));
    it.pass(4s);
    it.desk.take_over(it.now, it.wall, me);
    record = it.desk.take_changes().back();
    table after;
    after.now = it.now + 3s;
    after.wall = it.wall - 1h;
    after.desk.know(after.now, after.wall, record, me);
    CHECK(ends_after(after, 5) == 8s);
}

TEST_CASE("command desk: the boat's refusal for want of authority tells its epoch") {
    table it;
    it.there(xbee);
    it.begin(it.request(5));
    it.give();
    auto no = it.says(5, telecommand_stage::acknowledged);
    no.result = ack_code::no_authority;
    no.boat_obeys = 16'777'217; // 2^24 + 1: no float holds it
    it.desk.on_status(it.wall, xbee, no);
    auto outcome = it.desk.take_boat_epochs();
    REQUIRE(outcome.size() == 1);
    CHECK(outcome[0].sent_under == 4);
    CHECK(outcome[0].obeyed == 16'777'217);
    CHECK(it.desk.take_boat_epochs().empty());
    CHECK(it.status(5).result == ack_code::no_authority);
}

TEST_CASE("command desk: what cannot be is refused, and the number of telecommands is bounded") {
    desk_options small;
    small.max_open = 2;
    small.max_remembered = 3;
    table it(small);
    auto bad = it.request(1, 0);
    CHECK(it.desk.prepare(it.now, it.wall, bad, 1, "ana", 0, me).error().code() == ise::errc::invalid_argument);
    auto request = [&it](std::uint32_t id) {
        auto made = it.request(id);
        made.command = commands::reboot();
        return made;
    };
    for (std::uint32_t id = 1; id <= 10; ++id) {
        it.begin(request(id));
        it.desk.on_status(it.wall, xbee, it.says(id, telecommand_stage::acknowledged));
    }
    CHECK_FALSE(it.desk.find(7));
    CHECK(it.desk.find(8));
    it.begin(request(21));
    it.begin(request(22));
    CHECK(it.desk.prepare(it.now, it.wall, request(23), 1, "ana", 0, me).error().code() == ise::errc::overloaded);
    CHECK(it.desk.open().size() == 2);
    auto chosen = it.desk.find(21)->status;
    CHECK(chosen.command->kind() == command_kind::reboot);
}

TEST_CASE("router: pings of anybody leave room for the holder of the authority, and for the node's announcement") {
    desk_options small;
    small.max_open = 4;
    table it(small);
    auto request = [](std::uint32_t id, boat_command command) {
        telecommand_request made;
        made.id = id;
        made.command = command;
        return made;
    };
    auto ask = [&](std::uint32_t id, boat_command command, const std::string& who) {
        return it.desk.prepare(it.now, it.wall, request(id, command), 1, who, 4, me);
    };
    for (std::uint32_t id = 1; id <= 2; ++id) it.begin(request(id, commands::ping()));
    auto no = ask(3, commands::ping(), "eve");
    REQUIRE_FALSE(no);
    CHECK(no.error().code() == ise::errc::overloaded);
    CHECK_THAT(no.error().message(), Contains("2 telecommands that need no authority"));
    CHECK(ask(4, commands::ping(), me));
    it.begin(request(5, commands::waypoint_delete{0}));
    it.begin(request(6, commands::waypoint_delete{1}));
    CHECK_FALSE(ask(7, commands::waypoint_delete{2}, "ana"));
    CHECK(ask(8, commands::set_mode{sailing_mode::station_keep}, "ana"));
}

TEST_CASE("router: a newer order of a kind takes the place of the older one, wherever that waits") {
    table it;
    auto mode = [](std::uint32_t id, sailing_mode to) {
        auto made = table::request(id);
        made.command = commands::set_mode{to};
        return made;
    };
    it.begin(mode(1, sailing_mode::return_home)); // no link has it yet
    it.begin(mode(2, sailing_mode::hold));
    CHECK(it.status(1).state == telecommand_stage::failed);
    CHECK(it.status(1).text == "called back before it was sent (replaced by telecommand 2)");
    it.there(xbee);
    REQUIRE(it.give()->id == 2);
    it.desk.on_status(it.wall, xbee, it.says(2, telecommand_stage::sent));
    CHECK(it.begin(mode(3, sailing_mode::station_keep)).replaces == std::vector<std::uint32_t>{2});
    auto recalls = it.desk.take_recalls();
    REQUIRE(recalls.size() == 1);
    CHECK(recalls[0].id == 2);
    CHECK(recalls[0].link == xbee);
    REQUIRE(it.give()->id == 3);
    it.desk.on_status(it.wall, xbee, it.says(2, telecommand_stage::expired));
    CHECK(it.status(2).state == telecommand_stage::expired);
    CHECK_THAT(it.status(2).text, Contains("replaced by telecommand 3") && Contains("may have been executed"));
    auto parts = table::request(4);
    parts.command = commands::mission_stage{0, {28.1, -15.4}};
    it.begin(parts);
    parts.id = 5;
    parts.command = commands::mission_stage{1, {28.2, -15.4}};
    CHECK(it.begin(parts).replaces.empty());
    CHECK(it.desk.open_count() == 3);
}

TEST_CASE("router: an order at the other node is replaced too, and stays so when that node is silent") {
    table it, other;
    const std::string two = "shore/two";
    auto mode = [](std::uint32_t id, sailing_mode to) {
        auto made = table::request(id);
        made.command = commands::set_mode{to};
        return made;
    };
    it.there(xbee);
    other.there(xbee);
    auto older = it.begin(mode(1, sailing_mode::return_home));
    REQUIRE(it.give()->link == xbee);
    older = it.desk.take_changes().back();
    REQUIRE(other.desk.know(other.now, other.wall, older, two));
    // The operator goes on at the other node.
    auto newer = other.desk.prepare(other.now, other.wall, mode(2, sailing_mode::hold), 1, "ana", 4, two).value();
    REQUIRE(other.desk.know(other.now, other.wall, newer, two));
    CHECK(other.desk.is_called_back(1));
    SECTION("the first learns of it, and calls it back") {
        REQUIRE(it.desk.know(it.now, it.wall, newer, me));
        CHECK(it.desk.is_called_back(1));
        CHECK(it.desk.take_recalls().size() == 1);
    }
    SECTION("the first dies, and the other one calls it back from the link that may have it") {
        it.desk.on_status(it.wall, xbee, it.says(1, telecommand_stage::sent));
        other.desk.know(other.now, other.wall, it.desk.take_changes().back(), two); // told before it knew
        CHECK(other.desk.is_called_back(1));
        other.desk.take_over(other.now, other.wall, two);
        std::set<std::uint32_t> given;
        while (auto next = other.give()) {
            CHECK(next->only_recall == (next->id == 1));
            given.insert(next->id);
        }
        CHECK(given == std::set<std::uint32_t>{1, 2});
    }
}

TEST_CASE("router: one that is taken over is called back from every link to which the silent node gave it") {
    table it, other;
    const std::string two = "shore/two";
    it.there(xbee);
    it.there(gprs);
    it.begin(it.request(1));
    REQUIRE(it.give()->link == xbee);
    it.pass(21s);
    it.there(gprs);
    REQUIRE(it.give()->link == gprs);
    REQUIRE(other.desk.know(it.now, it.wall, it.desk.take_changes().back(), two));
    other.desk.take_over(it.now, it.wall, two);
    SECTION("by its operator") {
        auto have = other.desk.call_back(it.wall, 1, "by ana");
        CHECK(std::set(have.begin(), have.end()) == std::set{xbee, gprs});
        other.desk.on_status(it.wall, gprs, other.says(1, telecommand_stage::failed, "called back before it was sent"));
        CHECK_FALSE(is_final(other.status(1).state)); // xbee has it
        other.desk.on_status(it.wall, xbee, other.says(1, telecommand_stage::expired, "it may have arrived"));
        CHECK(other.status(1).state == telecommand_stage::expired);
    }
    SECTION("as the boat has answered over one of them") {
        other.desk.on_status(it.wall, gprs, other.says(1, telecommand_stage::acknowledged));
        auto recalls = other.desk.take_recalls();
        REQUIRE(recalls.size() == 1);
        CHECK(recalls[0].link == xbee);
    }
    SECTION("but not from a link that refused it") {
        it.desk.on_refused(it.now, it.wall, 1, xbee, "too many are open");
        table third;
        REQUIRE(third.desk.know(it.now, it.wall, it.desk.take_changes().back(), two));
        third.desk.take_over(it.now, it.wall, two);
        CHECK(third.desk.call_back(it.wall, 1, "by ana") == std::vector{gprs});
    }
}

TEST_CASE("router: the chosen link's word that it cannot be sent is the end of it") {
    table it;
    it.there(xbee);
    auto asked = it.request(6);
    asked.via = xbee;
    it.begin(asked);
    REQUIRE(it.give());
    it.desk.on_status(it.wall, xbee, it.says(6, telecommand_stage::failed, "it does not fit a frame"));
    CHECK(it.status(6).state == telecommand_stage::failed);
    CHECK_THAT(it.status(6).text, Contains("it does not fit a frame"));
}

TEST_CASE("router: of a telecommand that a link had when it fell silent nobody says that it was not sent") {
    table it;
    it.there(xbee);
    it.begin(it.request(5, 60));
    REQUIRE(it.give());
    it.desk.on_given(5, xbee); // its proxy was asked, and did not answer
    SECTION("the proxy says nothing more") {
        it.pass(60s);
        it.desk.on_time(it.now, it.wall);
        CHECK_THAT(it.status(5).text, Contains("xbee did not tell") && Contains("may have been executed"));
    }
    SECTION("the proxy says that its time was over") {
        it.desk.on_status(it.wall, xbee, it.says(5, telecommand_stage::expired));
        it.pass(60s);
        it.desk.on_time(it.now, it.wall);
        CHECK_THAT(it.status(5).text, Contains("before it could be sent"));
    }
    SECTION("the node is started anew meanwhile") {
        auto kept = it.desk.take_changes().back();
        table after;
        after.desk.know(it.now, it.wall, kept, me);
        after.desk.on_time(it.now + 60s, it.wall + 60s);
        CHECK_THAT(after.status(5).text, Contains("may have been executed"));
    }
    CHECK(it.status(5).state ==
          (it.now > ise::time_point(1h) ? telecommand_stage::expired : telecommand_stage::queued));
}

TEST_CASE("peer watch: packets are shown when both disks have them, or the other node is silent") {
    ise::time_point begin{1h};
    peer_watch alone(false, 3s, begin);
    CHECK_FALSE(alone.lives(begin));
    CHECK(alone.shown(10, begin) == 10);
    peer_watch it(true, 3s, begin);
    CHECK(it.lives(begin)); // it is given the time to come
    CHECK(it.shown(10, begin) == 0);
    CHECK(it.shown(10, begin + 3s) == 10);
    it.on_request(begin + 1s, true, 7, 2, 4, 1);
    CHECK(it.shown(10, begin + 2s) == 7);
    CHECK(it.shown(5, begin + 2s) == 5);
    CHECK(it.has_packets(7));
    CHECK_FALSE(it.has_packets(8));
    CHECK(it.has_commands(2));
    CHECK(it.has_authority(4, 1));
    CHECK(it.has_authority(3, 9));
    CHECK_FALSE(it.has_authority(4, 2));
    CHECK_FALSE(it.silent(begin + 3900ms));
    CHECK(it.silent(begin + 4s));
    it.on_request(begin + 5s, false, 7, 2, 4, 1); // it is there, its disk is full
    CHECK_FALSE(it.lives(begin + 5s));
    CHECK_FALSE(it.silent(begin + 5s));
    CHECK(it.shown(10, begin + 5s) == 10);
}

TEST_CASE("router: what no link has yet is called back at once, and what links have when they have given it up") {
    table it;
    it.begin(table::request(1));
    CHECK(it.status(1).valid_until == it.wall + 300s);
    CHECK(it.desk.call_back(it.wall, 1, "by ana").empty());
    CHECK(it.status(1).state == telecommand_stage::failed);
    CHECK(it.status(1).text == "called back before it was sent (by ana)");
    it.there(xbee);
    it.there(gprs);
    CHECK_FALSE(it.give());
    it.begin(table::request(2));
    REQUIRE(it.give());
    CHECK(it.desk.call_back(it.wall, 2, "by ana") == std::vector{xbee});
    CHECK(it.desk.is_called_back(2));
    it.pass(25s);
    it.there(gprs);
    CHECK_FALSE(it.give()); // no further link
    it.desk.on_status(it.wall, xbee, it.says(2, telecommand_stage::failed, "called back before it was sent"));
    CHECK(it.status(2).state == telecommand_stage::failed);
    it.begin(table::request(3));
    REQUIRE(it.give());
    it.desk.on_status(it.wall, xbee, it.says(3, telecommand_stage::sent));
    CHECK(it.desk.call_back(it.wall, 3, "by ana") == std::vector{xbee});
    CHECK_FALSE(is_final(it.status(3).state));
    it.desk.on_status(it.wall, xbee, it.says(3, telecommand_stage::expired, "it may have arrived"));
    CHECK(it.status(3).state == telecommand_stage::expired);
    CHECK_THAT(it.status(3).text, ise_test::Contains("it may have been executed"));
    it.begin(table::request(4));
    REQUIRE(it.give());
    it.desk.call_back(it.wall, 4, "by ana");
    it.desk.on_status(it.wall, xbee, it.says(4, telecommand_stage::acknowledged)); // it was executed in time
    CHECK(it.status(4).state == telecommand_stage::acknowledged);
    CHECK(it.desk.call_back(it.wall, 4, "by ana").empty());
    CHECK(it.status(4).state == telecommand_stage::acknowledged);
}

TEST_CASE("router: a telecommand whose time was over before it came is refused with both times") {
    table it;
    auto late = table::request(1);
    late.valid_until = it.wall - 5min;
    auto refused = it.desk.prepare(it.now, it.wall, late, 77, "ana", 4, "node");
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), ise_test::Contains("is the clock there right?"));
    auto usual = table::request(2);
    usual.valid_s.reset();
    CHECK(it.desk.prepare(it.now, it.wall, usual, 77, "ana", 4, "node", iridium)->valid_until == it.wall + 900s);
    CHECK(it.desk.prepare(it.now, it.wall, usual, 77, "ana", 4, "node", xbee)->valid_until == it.wall + 30s);
    usual.via = iridium;
    CHECK(it.desk.prepare(it.now, it.wall, usual, 77, "ana", 4, "node", xbee)->valid_until == it.wall + 900s);
}

} // namespace command_desk_test
