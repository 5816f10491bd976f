// The table "What is guaranteed over which transport" of ise/wire/FORMAT.md, row by row: order, loss, duplication, and
// what a subscriber learns.
#include "traffic.hpp"

#include <algorithm>

using namespace conformance;

namespace {

void in_order_and_counted(pair& at) {
    auto out = at.boat.publish(position);
    at.open();
    out(numbered(1));
    auto got = follow(at.shore, at.there, ise::subscribe_options::keep_last(8));
    at.run_until([&] { return got->any(); });
    CHECK(got->subscribed);
    for (int i = 2; i <= 501; ++i) {
        out(numbered(i));
        if (i % 25 == 0) at.run_until([&] { return got->last() == i; });
    }
    at.run_until([&] { return got->last() == 501; });
    CHECK(got->packets.front() == 1); // the last value
    got->check_exact();
    CHECK(got->packets.size() + got->lost() == 501);
}

using watch = ise::subscription<fix, set_mode, mode_set>;
constexpr watch watched{"watched"};

ise::task<> publish_on(ise::loop& on, publication<watch> to, std::shared_ptr<int> published) {
    co_await ise::sleep_for(on, 0s);
    for (int i = 0; i < 5; ++i) to(numbered(++*published));
}
ise::task<subscriber<watch>> subscribe_watch(ise::remote from) {
    ise::subscribe_options later;
    later.last_value = false;
    later.deadline = 1min;
    set_mode asked{"x"};
    auto made = co_await subscribe_to(from, watched, std::move(asked), later);
    co_return made;
}
ise::task<double> first_of(std::shared_ptr<subscriber<watch>> from) {
    auto packet = co_await from->next();
    co_return packet->latitude_deg - static_cast<double>(packet.lost_before().value());
}

// The provider publishes while it decides, and goes on at once when it has.
void answer_first(pair& at) {
    auto published = std::make_shared<int>(0);
    auto out = std::make_shared<publication<watch>>();
    ise::publication_callbacks<watch> callbacks;
    callbacks.on_subscribe = [&at, published, own = std::weak_ptr(out)](const set_mode&,
                                                                        const ise::subscriber_info&) -> mode_set {
        auto to = own.lock(); // it holds this callback
        if (!to) return mode_set{false, "the test is over"};
        (*to)(numbered(++*published));
        at.boat.scope.spawn("publisher", publish_on(at.boat.on, *to, published));
        return mode_set{true, std::to_string(*published)};
    };
    *out = at.boat.publish(watched, std::move(callbacks));
    at.open();
    for (int round = 1; round <= 10; ++round) {
        auto got = std::make_shared<subscriber<watch>>(at.run(subscribe_watch(at.there)));
        CHECK(got->response().accepted);
        // The first one behind the answer came, or was counted.
        CHECK(at.run(first_of(got)) == std::stod(got->response().reason) + 1);
    }
}

// Where datagrams are doubled, lost and overtaken on the way; streams are what they are.
void once(pair& at) {
    auto out = at.boat.publish(position);
    if (at.has.relay_at.empty()) at.open();
    else at.open_through_relay();
    if (at.between) at.between->roughen();
    auto got = follow(at.shore, at.there, ise::subscribe_options::keep_last(1000));
    at.run_until([&] { return got->subscribed; });
    for (int i = 1; i <= 500; ++i) {
        out(numbered(i));
        if (i % 10 == 0) at.run_until([&] { return got->last() == i; });
    }
    // Each once, never backwards.
    CHECK(std::ranges::adjacent_find(got->packets, std::greater_equal<>()) == got->packets.end());
    got->check_exact();
    CHECK(got->counts().received == got->packets.size());
    if (at.has.datagrams) CHECK(got->lost() > 0); // it was rough
    else CHECK(got->packets.size() == 500);
}

void exact_gap(pair& at) {
    auto out = at.boat.publish(position);
    at.open();
    auto got = follow(at.shore, at.there, ise::subscribe_options::keep_last(4));
    at.run_until([&] { return out.subscribers() == 1; });
    for (int i = 1; i <= 10; ++i) out(numbered(i));
    at.run_until([&] { return got->last() == 10; });
    at.cut();
    for (int i = 11; i <= 40; ++i) out(numbered(i)); // more than is kept; some go into the dead connection
    at.run_until([&] { return got->last() == 40; });
    got->check_exact();
    CHECK(got->lost() >= 26);
    CHECK((got->counts().resumed == 1 && got->counts().restarts == 0));
    CHECK(out.subscribers() == 1);
}

struct parting {
    std::string word;
};
struct parted {
    std::string word = "default";
};
using rental = ise::subscription<fix, set_mode, mode_set, parting, parted>;
constexpr rental rented("rented");

ise::task<std::string> rent_and_leave(ise::remote from) {
    ise::subscribe_options options;
    options.deadline = 1min;
    set_mode asked{"x"};
    auto made = co_await subscribe_to(from, rented, std::move(asked), options);
    parting said{"fair winds"};
    auto answer = co_await made.unsubscribe(said, 1min);
    co_return answer.word;
}

void leaves_with_a_word(pair& at) {
    std::vector<std::string> heard;
    ise::publication_callbacks<rental> callbacks;
    callbacks.on_unsubscribe = [&](const parting& said, const ise::subscriber_info&) {
        heard.push_back(said.word);
        return parted{"and following seas"};
    };
    auto out = at.boat.publish(rented, std::move(callbacks));
    at.open();
    CHECK(at.run(rent_and_leave(at.there)) == "and following seas");
    CHECK(heard == std::vector<std::string>{"fair winds"});
    CHECK(out.subscribers() == 0);
}

// What was under way when the session broke goes again, and what was published meanwhile goes too.
void lossless_over_a_cut(pair& at) {
    if (!at.has.lossless) return;
    auto out = at.boat.publish(position);
    at.open();
    auto got = follow(at.shore, at.there, ise::subscribe_options::lossless(50));
    at.run_until([&] { return got->subscribed; });
    for (int round = 0; round < 5; ++round) {
        for (int i = 1; i <= 20; ++i) out(numbered(40 * round + i)); // they are on their way
        at.cut();
        for (int i = 21; i <= 40; ++i) out(numbered(40 * round + i));
        at.run_until([&] { return got->last() == 40 * round + 40; });
    }
    got->check_exact();
    CHECK(got->packets.size() == 200);
    CHECK(got->lost() == 0);
    CHECK(got->counts().resumed == 5);
    at.cut();
    for (int i = 201; i <= 400; ++i) out(numbered(i)); // more than may be kept
    at.run_until([&] { return got->stream->ended(); });
    // Overrun before the provider noticed the cut, the subscription is no more when its subscriber comes back for it.
    auto cause = got->stream->cause().code();
    CHECK((cause == errc::overloaded || cause == errc::peer_lost));
    CHECK(got->packets.size() == 200);
    CHECK(got->counts().lost_at_provider == 200);
}

void unknown_after_restart(pair& at) {
    auto out = at.boat.publish(position);
    at.open();
    auto got = follow(at.shore, at.there, ise::subscribe_options::keep_last(4));
    at.run_until([&] { return out.subscribers() == 1; });
    out(numbered(100));
    at.run_until([&] { return got->last() == 100; });
    auto& next = at.next_life();
    auto again = next.publish(position);
    again(numbered(200));
    at.listen_again();
    at.run_until([&] { return got->last() == 200; }); // its last value
    again(numbered(300));
    at.run_until([&] { return got->last() == 300; });
    CHECK(got->packets == std::vector<double>{100, 200, 300});
    CHECK(got->gaps == std::vector<std::optional<std::uint64_t>>{0, std::nullopt, 0});
    CHECK((got->counts().restarts == 1 && got->counts().resumed == 0));
}

void unknown_after_linger(pair& at) {
    auto out = at.boat.publish(position);
    at.open();
    auto got = follow(at.shore, at.there, ise::subscribe_options::keep_last(4));
    at.run_until([&] { return out.subscribers() == 1; });
    out(numbered(1));
    at.run_until([&] { return got->last() == 1; });
    at.strike(fault::reset); // the provider has forgotten it before the requester knows
    at.run_until([&] { return out.subscribers() == 0; });
    out(numbered(2));
    at.run_until([&] { return got->last() == 2; });
    CHECK(got->gaps == std::vector<std::optional<std::uint64_t>>{0, std::nullopt});
    CHECK((got->counts().restarts == 1 && got->counts().resumed == 0));
}

} // namespace

TEMPLATE_TEST_CASE("order holds within a subscription, and nothing is lost that is not counted", "",
                   OVER_EVERY_TRANSPORT) {
    over<TestType>(in_order_and_counted);
}

TEMPLATE_TEST_CASE("the answer precedes the first packet of a subscription", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(answer_first);
}

TEMPLATE_TEST_CASE("a packet is given to its subscriber at most once", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(once);
}

TEMPLATE_TEST_CASE("a subscription resumes after the session was lost, with the exact gap", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(exact_gap);
}

TEMPLATE_TEST_CASE("who leaves a subscription gets the provider's answer to what it says", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(leaves_with_a_word);
}

TEMPLATE_TEST_CASE("a lossless subscription gets every packet over lost sessions, or ends with the number that is lost",
                   "", OVER_EVERY_TRANSPORT) {
    over<TestType>(lossless_over_a_cut);
}

TEMPLATE_TEST_CASE("after a restart of the provider a subscription goes on with a gap of unknown length", "",
                   OVER_EVERY_TRANSPORT) {
    over<TestType>(unknown_after_restart);
}

TEMPLATE_TEST_CASE("beyond the linger a subscription goes on with a gap of unknown length", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(unknown_after_linger, [](ise::service_options& options) { options.linger = 0s; });
}
