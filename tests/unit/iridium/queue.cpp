#include <components/iridium_proxy/mt_path.hpp>
#include <components/iridium_proxy/sbd_policy.hpp>
#include <components/iridium_proxy/sbd_store.hpp>

#include <support/catch.hpp>

namespace queue_test {

using namespace atirma;
using std::chrono::duration_cast;
using std::chrono::seconds;
using std::chrono::sys_days;
using namespace std::chrono_literals;

namespace {

constexpr utc_time start = sys_days(2026y / 11 / 21) + 20h;

telecommand_request request(std::uint32_t id, command_kind kind, float valid_s = 3600) {
    telecommand_request made;
    made.id = id;
    made.command = boat_command(kind);
    made.valid_s = valid_s;
    return made;
}

link_outcome outcome(link_outcome::kind what, std::string text = "text") {
    return make_outcome(what, std::move(text), "4114651");
}

acknowledgement answer(std::uint32_t id, command_kind kind) {
    acknowledgement ack;
    ack.id = id;
    ack.kind = kind;
    ack.text = "hold";
    return ack;
}

ise::result<ise::http_answer> answered(int status, std::string body) {
    ise::http_answer made;
    made.status = status;
    made.body = std::move(body);
    return made;
}

/// The tracker as the proxy uses it: on civil time, within a budget.
struct queue_of_sbd {
    telecommand_tracker tracker;

    explicit queue_of_sbd(link_policy policy = sbd_policy()) : tracker(std::move(policy)) {}
    void restore(utc_time now, std::vector<tracked_telecommand> kept) {
        tracker.restore(civil_tracker_time(now), std::move(kept));
    }
    ise::result<std::uint32_t> submit(utc_time now, const telecommand_request& asked, std::uint32_t chosen) {
        return tracker.submit(civil_tracker_time(now), asked, chosen);
    }
    std::optional<telecommand_tracker::due> next_due(utc_time now, std::optional<std::uint64_t> credits) {
        link_budget budget;
        if (credits) budget = budget_after(1000, 1000 - *credits, 0, 0);
        return next_within_budget(tracker, civil_tracker_time(now), budget, 50);
    }
    void on_outcome(utc_time now, std::uint32_t id, const link_outcome& what) {
        tracker.on_outcome(civil_tracker_time(now), id, what);
    }
    bool on_acknowledgement(utc_time now, const acknowledgement& ack) {
        return tracker.on_acknowledgement(civil_tracker_time(now), ack);
    }
    bool recall(utc_time now, std::uint32_t id, const std::string& why) {
        return tracker.recall(civil_tracker_time(now), id, why);
    }
    const tracked_telecommand* find(std::uint32_t id) const { return tracker.find(id); }
    telecommand_stage stage(std::uint32_t id) const { return status_of(*find(id), link_id::iridium).state; }
    utc_time next_event() const { return civil_time_of(tracker.next_event()); }
};

sbd_store opened(const std::string& name) { return std::move(sbd_store::open("memory:" + name).value()); }

} // namespace

TEST_CASE("iridium: a telecommand goes under the epoch of authority that it was given with, also after a restart") {
    auto steer = request(7, command_kind::tack_now);
    steer.authority = 6;
    auto store = opened("authority");
    queue_of_sbd queue;
    queue.submit(start, steer, 0).value();
    store.save(*queue.find(7)).value();
    queue_of_sbd again;
    again.restore(start, store.load().value());
    for (auto* one : {&queue, &again}) {
        auto due = one->next_due(start, {});
        REQUIRE(due);
        auto sent = parse_telecommand(due->raw);
        REQUIRE(sent);
        CHECK(sent->authority == 6);
    }
    // Asked for again once the authority was taken anew.
    queue_of_sbd waits;
    waits.submit(start, steer, 0).value();
    steer.authority = 8;
    waits.submit(start, steer, 0).value();
    CHECK(waits.find(7)->authority == 8);
}

TEST_CASE("iridium: an answer to what was sent under authority names its epoch, another one is nobody's, also after a "
          "restart") {
    auto store = opened("epochs");
    queue_of_sbd queue;
    auto steer = request(7, command_kind::tack_now);
    steer.authority = 6;
    queue.submit(start, steer, 0).value();
    REQUIRE(queue.next_due(start, {}));
    queue.on_outcome(start, 7, outcome(link_outcome::kind::accepted));
    steer.authority = 8; // asked for again: the gateway has it under the old one
    queue.submit(start, steer, 0).value();
    store.save(*queue.find(7)).value();
    queue_of_sbd again;
    again.restore(start, store.load().value());
    for (auto* one : {&queue, &again}) {
        auto ack = answer(7, command_kind::tack_now);
        CHECK_FALSE(one->on_acknowledgement(start, ack));
        for (std::uint32_t forged : {0u, 4u, 8u, 0xFFFFFFFFu}) {
            ack.authority = forged;
            CHECK_FALSE(one->on_acknowledgement(start, ack));
        }
        CHECK(one->find(7)->stage == link_stage::at_gateway);
        ack.authority = 6;
        CHECK(one->on_acknowledgement(start, ack));
        CHECK(one->find(7)->boat_obeys == 6u);
    }
    steer.id = 9;
    queue.submit(start, steer, 0).value();
    REQUIRE(queue.next_due(start, {}));
    auto no = answer(9, command_kind::tack_now);
    no.code = ack_code::no_authority;
    no.authority = 12;
    CHECK(queue.on_acknowledgement(start, no));
}

TEST_CASE("iridium: what the boat has answered over another link is called back while it waits, and only then") {
    queue_of_sbd queue;
    queue.submit(start, request(1, command_kind::ping), 0).value();
    queue.submit(start, request(2, command_kind::set_mode), 0).value();
    auto due = queue.next_due(start, {});
    REQUIRE(due);
    REQUIRE(due->id == 2);
    CHECK(queue.recall(start, 1, "acknowledged over gprs"));
    CHECK(queue.stage(1) == telecommand_stage::failed);
    CHECK(queue.find(1)->asked_at == start);
    CHECK_FALSE(queue.recall(start, 1, "again"));
    CHECK_FALSE(queue.recall(start, 2, "it is being given")); // to the gateway
    queue.on_outcome(start, 2, outcome(link_outcome::kind::accepted));
    CHECK_FALSE(queue.recall(start, 2, "the gateway has it"));
    CHECK_FALSE(queue.recall(start, 3, "nobody knows it"));
    CHECK_FALSE(queue.next_due(start + 1h, {}));
    // One whose attempt ended in the dark may be on its way.
    queue.submit(start, request(4, command_kind::ping), 0).value();
    REQUIRE(queue.next_due(start, {}));
    queue.on_outcome(start, 4, outcome(link_outcome::kind::unknown));
    CHECK(queue.recall(start + 1s, 4, "acknowledged over xbee"));
    CHECK(queue.stage(4) == telecommand_stage::expired);
}

TEST_CASE("iridium: telecommands go by priority, then by age, one at a time") {
    queue_of_sbd queue;
    queue.submit(start, request(1, command_kind::ping), 0).value();
    queue.submit(start, request(2, command_kind::waypoint_clear), 0).value();
    queue.submit(start, request(3, command_kind::set_mode), 0).value();
    queue.submit(start, request(4, command_kind::tack_now), 0).value();
    std::vector<std::uint32_t> order;
    for (int i = 0; i < 4; ++i) {
        auto due = queue.next_due(start, {});
        REQUIRE(due);
        CHECK_FALSE(queue.next_due(start, {}));
        order.push_back(due->id);
        queue.on_outcome(start, due->id, outcome(link_outcome::kind::accepted));
    }
    CHECK(order == std::vector<std::uint32_t>{3, 2, 4, 1});
    CHECK_FALSE(queue.next_due(start + 30min, {})); // what the gateway has is not sent again
    CHECK(queue.find(3)->stage == link_stage::at_gateway);
    CHECK(queue.stage(3) == telecommand_stage::sent);
}

TEST_CASE("iridium: a telecommand is followed from the shore to the boat's answer") {
    queue_of_sbd queue;
    queue.submit(start, request(7, command_kind::set_mode), 0).value();
    std::vector<link_stage> stages;
    auto note = [&] {
        for (const auto& change : queue.tracker.take_changes()) stages.push_back(change.stage);
    };
    note();
    auto due = queue.next_due(start, {});
    note();
    queue.on_outcome(start, 7, outcome(link_outcome::kind::accepted));
    note();
    queue.tracker.on_delivered(civil_tracker_time(start + 10min));
    note();
    CHECK_FALSE(queue.on_acknowledgement(start + 11min, answer(7, command_kind::ping)));
    CHECK_FALSE(queue.on_acknowledgement(start + 11min, answer(8, command_kind::set_mode)));
    CHECK(queue.on_acknowledgement(start + 11min, answer(7, command_kind::set_mode)));
    note();
    using enum link_stage;
    CHECK(stages == std::vector{waiting, sending, at_gateway, delivered, acknowledged});
    CHECK(queue.tracker.open().empty());
    CHECK(queue.find(7)->text == "hold");
}

TEST_CASE("iridium: what may pass is tried again with growing pauses, what cannot is failed") {
    queue_of_sbd queue;
    queue.submit(start, request(1, command_kind::ping, 80000), 0).value();
    auto now = start;
    std::vector<seconds> pauses;
    for (int i = 0; i < 10; ++i) {
        REQUIRE(queue.next_due(now, {}));
        queue.on_outcome(now, 1, outcome(link_outcome::kind::later));
        CHECK(queue.stage(1) == telecommand_stage::queued);
        CHECK_FALSE(queue.next_due(now, {}));
        auto next = queue.next_event();
        pauses.push_back(duration_cast<seconds>(next - now));
        now = next;
    }
    CHECK(pauses.front() == 5s);
    CHECK(pauses[3] == 40s);
    CHECK(pauses.back() == 900s);
    REQUIRE(queue.next_due(now, {}));
    queue.on_outcome(now, 1, outcome(link_outcome::kind::unknown));
    CHECK(queue.stage(1) == telecommand_stage::sent); // it may have left
    now = queue.next_event();
    REQUIRE(queue.next_due(now, {}));
    queue.on_outcome(now, 1, outcome(link_outcome::kind::refused, "no credit"));
    CHECK(queue.find(1)->stage == link_stage::expired); // the attempt in the dark may have arrived
    CHECK(queue.find(1)->text.starts_with("no credit; an attempt before may have arrived"));
    CHECK(queue.tracker.next_event() == ise::time_point::max());
}

TEST_CASE(
    "iridium: what was sealed before the boat's session was known is sent again once it is, also after a restart") {
    auto store = opened("unreadable");
    queue_of_sbd queue;
    for (std::uint32_t id : {1u, 2u, 3u}) {
        queue.submit(start, request(id, command_kind::set_mode), 0).value();
        REQUIRE(queue.next_due(start, {})->id == id);
        queue.tracker.mark_unreadable(id, id != 2); // the boat may have executed 2
        queue.on_outcome(start, id, outcome(link_outcome::kind::accepted));
    }
    REQUIRE(queue.on_acknowledgement(start, answer(3, command_kind::set_mode))); // over another link
    for (const auto& entry : queue.tracker.take_changes()) store.save(entry).value();
    queue_of_sbd again;
    again.restore(start + 1min, store.load().value());
    for (auto* one : {&queue, &again}) {
        CHECK_FALSE(one->next_due(start + 2min, {}));
        one->tracker.repeat_unreadable(civil_tracker_time(start + 2min));
        CHECK(one->stage(1) == telecommand_stage::sent); // as it was reported before
        auto due = one->next_due(start + 2min, {});
        REQUIRE(due);
        CHECK(due->id == 1);
        one->tracker.mark_unreadable(1, false);
        one->on_outcome(start + 2min, 1, outcome(link_outcome::kind::accepted));
        one->tracker.repeat_unreadable(civil_tracker_time(start + 3min));
        CHECK_FALSE(one->next_due(start + 3min, {}));
        CHECK(one->find(2)->stage == link_stage::at_gateway);
        CHECK(one->find(3)->stage == link_stage::acknowledged);
    }
}

TEST_CASE("iridium: what the boat cannot open is called back though the gateway has it") {
    queue_of_sbd queue;
    queue.submit(start, request(1, command_kind::set_mode), 0).value();
    REQUIRE(queue.next_due(start, {}));
    queue.tracker.mark_unreadable(1, true);
    queue.on_outcome(start, 1, outcome(link_outcome::kind::accepted));
    CHECK(queue.recall(start, 1, "by ana"));
    CHECK(queue.stage(1) == telecommand_stage::failed); // it was certainly not executed
    queue.tracker.repeat_unreadable(civil_tracker_time(start));
    CHECK_FALSE(queue.next_due(start, {}));
}

TEST_CASE("iridium: the time of the queue does not go back where the machine starts anew with its clock set back") {
    auto store = opened("queue_clock");
    CHECK(store.clock().value().last == utc_time());
    queue_clock before;
    REQUIRE(before.read(start, ise::time_point(100h)) == start);
    store.keep(before).value();
    SECTION("the process alone was started anew") {
        auto after = store.clock().value();
        CHECK(after.read(start - 10h, ise::time_point(100h + 30s)) == start + 30s);
    }
    SECTION("the machine was") {
        auto after = store.clock().value();
        CHECK(after.read(start - 10h, ise::time_point(1min)) == start);
        CHECK(after.read(start - 10h, ise::time_point(2min)) == start + 1min);
        CHECK(after.read(start + 1h, ise::time_point(3min)) == start + 1h); // it was off for an hour
    }
}

TEST_CASE("iridium: a budget that is spent holds the queue until midnight UTC") {
    queue_of_sbd queue;
    queue.submit(start, request(1, command_kind::ping, 80000), 0).value();
    queue.submit(start, request(2, command_kind::set_mode, 80000), 0).value();
    CHECK_FALSE(queue.next_due(start, 0));
    CHECK(queue.find(2)->text.find("budget") != std::string::npos);
    CHECK(queue.next_event() == sys_days(2026y / 11 / 22));
    auto due = queue.next_due(sys_days(2026y / 11 / 22), 1);
    REQUIRE(due);
    CHECK(due->id == 2);
    CHECK(credits_of(0, 50) == 1);
    CHECK(credits_of(50, 50) == 1);
    CHECK(credits_of(51, 50) == 2);
    CHECK(credits_of(270, 50) == 6);
}

TEST_CASE("iridium: validity ends waiting, and says what may have happened, and an answer after that still counts") {
    queue_of_sbd queue;
    queue.submit(start, request(1, command_kind::ping, 60), 0).value();
    queue.submit(start, request(2, command_kind::set_mode, 60), 0).value();
    REQUIRE(queue.next_due(start, {})->id == 2);
    queue.on_outcome(start, 2, outcome(link_outcome::kind::accepted));
    CHECK(queue.next_event() <= start + 60s);
    queue.tracker.on_time(civil_tracker_time(start + 60s));
    CHECK(queue.find(1)->stage == link_stage::expired);
    CHECK(queue.find(1)->text.find("before it could be sent") != std::string::npos);
    CHECK(queue.find(2)->text.find("gateway") != std::string::npos);
    CHECK(queue.on_acknowledgement(start + 2h, answer(2, command_kind::set_mode)));
    CHECK(queue.find(2)->stage == link_stage::acknowledged);
}

TEST_CASE("iridium: the same id is the same telecommand, and nonsense and too many are refused") {
    auto options = sbd_policy();
    options.max_open = 4; // half of it for what needs no authority
    queue_of_sbd queue(options);
    CHECK(queue.submit(start, request(5, command_kind::ping), 0).value() == 5);
    CHECK(queue.submit(start, request(5, command_kind::ping), 0).value() == 5);
    CHECK(queue.submit(start, request(5, command_kind::reboot), 0).error().code() == ise::errc::invalid_argument);
    CHECK(queue.submit(start, request(6, command_kind::ping, 0), 0).error().code() == ise::errc::invalid_argument);
    CHECK(queue.submit(start, request(6, static_cast<command_kind>(99)), 0).error().code() ==
          ise::errc::invalid_argument);
    CHECK(queue.submit(start, request(0, command_kind::ping), 77).value() == 77);
    CHECK(queue.submit(start, request(8, command_kind::ping), 0).error().code() == ise::errc::overloaded);
    queue.tracker.forget(77);
    CHECK(queue.submit(start, request(8, command_kind::ping), 0));
}

TEST_CASE("iridium: RockBLOCK's answers are told apart: taken, never, later, unknown") {
    using kind = link_outcome::kind;
    CHECK(outcome_of_rockblock(answered(200, "OK,4114651")).what == kind::accepted);
    CHECK(outcome_of_rockblock(answered(200, "OK,4114651")).reference == "4114651");
    for (int code : {10, 11, 12, 13, 14, 15, 16}) {
        auto result = outcome_of_rockblock(answered(200, "FAILED," + std::to_string(code) + ",words"));
        CHECK(result.what == kind::refused);
        CHECK(result.text.find("FAILED " + std::to_string(code)) != std::string::npos);
    }
    CHECK(outcome_of_rockblock(answered(200, "FAILED,99,System Error")).what == kind::later);
    CHECK(outcome_of_rockblock(answered(404, "<html>")).what == kind::later);
    CHECK(outcome_of_rockblock(answered(502, "Bad gateway")).what == kind::unknown);
    CHECK(outcome_of_rockblock(ise::failure(ise::errc::unreachable, "no route")).what == kind::later);
    CHECK(outcome_of_rockblock(ise::failure(ise::errc::timed_out, "late", ise::execution::unknown)).what ==
          kind::unknown);
    CHECK(outcome_of_rockblock(ise::failure(ise::errc::peer_lost, "gone", ise::execution::unknown)).what ==
          kind::unknown);
}

TEST_CASE("iridium: the queue on disk comes back as it was, and what was being sent is sent again") {
    auto store = opened("queue_restart");
    {
        queue_of_sbd queue;
        auto insert = request(3, command_kind::waypoint_insert, 7200);
        insert.command = commands::waypoint_insert{2, {28.1534567891234, -15.4480000000001}};
        queue.submit(start, request(1, command_kind::set_mode), 0).value();
        queue.submit(start, request(2, command_kind::set_mode), 0).value();
        queue.submit(start, insert, 0).value();
        REQUIRE(queue.next_due(start, {})->id == 1);
        queue.on_outcome(start, 1, outcome(link_outcome::kind::accepted));
        REQUIRE(queue.next_due(start, {})->id == 2);
        for (const auto& entry : queue.tracker.take_changes()) store.save(entry).value();
    }
    queue_of_sbd again;
    auto kept = store.load().value();
    REQUIRE(kept.size() == 3);
    again.restore(start + 1min, std::move(kept));
    CHECK(again.find(1)->stage == link_stage::at_gateway);
    CHECK(again.find(1)->reference == "4114651");
    CHECK(again.find(2)->stage == link_stage::waiting);
    CHECK(again.find(2)->may_have_left);
    CHECK(again.find(3)->command == boat_command(commands::waypoint_insert{2, {28.1534567891234, -15.4480000000001}}));
    CHECK(again.find(3)->expires_at == civil_tracker_time(start + 2h).now);
    CHECK(again.next_due(start + 1min, {})->id == 2);
    auto other = request(3, command_kind::waypoint_insert, 7200);
    CHECK_FALSE(again.submit(start, other, 0)); // the id stands for another place
    // Later than its validity: it comes back expired.
    queue_of_sbd late;
    late.restore(start + 10h, store.load().value());
    CHECK(late.tracker.open().empty());
    CHECK(late.find(3)->stage == link_stage::expired);
}

TEST_CASE(
    "iridium: a message of the boat is kept once, by imei, momsn and session time, and waits until it is handed on") {
    auto store = opened("messages");
    iridium::mo_message m;
    m.imei = "300234010753370";
    m.momsn = 5;
    m.session_time = std::chrono::sys_seconds(1'700'000'000s);
    m.where = iridium::estimate{28, -15, 3};
    m.data = ise::bytes(60, std::byte{7});
    CHECK(store.add(m, "http", start, 2).value());
    CHECK_FALSE(store.add(m, "mail", start + 1s, 2).value());
    auto wrapped = m; // momsn has come round
    wrapped.session_time += 24h;
    CHECK(store.add(wrapped, "http", start + 24h, 2).value());
    auto waiting = store.unpublished(10).value();
    REQUIRE(waiting.size() == 2);
    CHECK(waiting[0].message == m);
    CHECK(waiting[0].received_at == start);
    CHECK(store.unpublished(10, waiting[0].row).value().size() == 1);
    store.published(waiting[0].row).value();
    CHECK(store.count_unpublished().value() == 1);
    store.forget_before(start + 48h).value();
    CHECK(store.count_unpublished().value() == 1); // never what nobody has seen
}

TEST_CASE("iridium: spending is summed by day and month, and a refund takes it back") {
    auto store = opened("spending");
    tracked_telecommand entry;
    entry.id = 1;
    store.begin_attempt(entry, start, 30, 1).value();
    store.begin_attempt(entry, start + 1h, 70, 2).value();
    store.begin_attempt(entry, start + 24h, 30, 1).value();
    store.refund(start + 1h, 70, 2).value();
    iridium::mo_message m;
    m.imei = "300234010753370";
    m.data = ise::bytes(340);
    store.add(m, "http", start, 7).value();
    store.add(m, "http", start, 7).value(); // the same again costs nothing
    auto today = store.spent_on(start).value();
    CHECK(today.mt_messages == 1);
    CHECK(today.mt_bytes == 30);
    CHECK(today.mt_credits == 1);
    CHECK(today.mo_messages == 1);
    CHECK(today.mo_credits == 7);
    CHECK(store.spent_in_month_of(start).value().mt_credits == 2);
    CHECK(store.spent_in_month_of(start + 24h * 40).value() == iridium_spending{});
    CHECK(store.spent_ever().value().mt_messages == 2);
}

} // namespace queue_test
