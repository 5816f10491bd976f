// The table "What is guaranteed over which transport" of ise/wire/FORMAT.md, row by row: who is slow, and what that
// costs.
#include "traffic.hpp"

#include <algorithm>

using namespace conformance;

namespace {

ise::task<> send_all(fixes to, int count) {
    for (int i = 1; i <= count; ++i) {
        auto packet = numbered(i);
        co_await to.send(packet);
    }
}

void lossless(pair& at) {
    auto out = at.boat.publish(position);
    at.open();
    if (!at.has.lossless) {
        try {
            sit(at, ise::subscribe_options::lossless(5));
            FAIL("it was not refused");
        } catch (const ise::error& refused) {
            CHECK(refused.code() == errc::invalid_argument);
            CHECK_THAT(refused.what(), ise_test::Contains("udp"));
        }
        CHECK(out.subscribers() == 0);
        return;
    }
    auto got = sit(at, ise::subscribe_options::lossless(5));
    auto sender = start(at.boat.on, send_all(out, 300));
    for (int pause = 0; pause < 20; ++pause) { // it stops reading, and the publisher waits for it
        at.run_until([&] {
            return got->counts().received >= got->packets.size() + 4 && out.published() == got->counts().received + 5;
        });
        auto calls = at.run(try_helm(at.there, "meanwhile", 10s)); // others do not wait
        CHECK(calls.error().code() == errc::no_such_service);
        CHECK_FALSE(sender->done);
        CHECK(out.published() <= got->packets.size() + 10); // five here, five held back there
        drain(*got);
    }
    at.run_until([&] {
        drain(*got);
        return got->packets.size() == 300;
    });
    at.run_until([&] { return sender->done; });
    sender->get();
    CHECK(got->lost() == 0);
    got->check_exact();
}

// One reader takes nothing, another over the same session takes all; the publisher waits for neither.
void stalled_reader(pair& at) {
    auto out = at.boat.publish(position);
    auto core = at.boat.services->services().find_publication("position");
    at.open();
    auto idle = sit(at, ise::subscribe_options::keep_last(4));
    auto busy = follow(at.shore, at.there, ise::subscribe_options::keep_last(64));
    at.run_until([&] { return busy->subscribed; });
    for (int i = 1; i <= 1000; ++i) {
        REQUIRE(out.try_send(numbered(i))); // never waits
        CHECK(core->queued() <= 4 + 64);
        if (i % 20 == 0) at.run_until([&] { return busy->last() == i; });
    }
    at.run_until([&] { return idle->counts().received + idle->counts().lost_at_provider == 1000; });
    drain(*idle);
    CHECK(idle->packets.size() == 4); // what it asked to be kept, and no more
    CHECK(idle->packets.back() == 1000);
    CHECK(idle->packets.size() + idle->lost() == 1000);
    busy->check_exact();
    CHECK(busy->counts().lost_here == 0);
    if (!at.has.datagrams) CHECK(busy->lost() == 0);
}

ise::task<> count_pictures(ise::remote from, std::shared_ptr<std::uint64_t> result) {
    ise::subscribe_options deep = ise::subscribe_options::keep_last(1000);
    auto stream = co_await subscribe_to(from, pictures, deep);
    for (;;) {
        auto packet = co_await stream.next();
        if (!packet) co_return;
        *result += 1 + packet.lost_before().value();
    }
}

// However deep a subscriber wants it, no more bytes wait for it than the provider allows.
void bounded_bytes(pair& at) {
    auto out = at.boat.publish(pictures);
    auto core = at.boat.services->services().find_publication("pictures");
    at.open();
    auto result = std::make_shared<std::uint64_t>(0);
    at.shore.scope.spawn("reader", count_pictures(at.there, result));
    at.run_until([&] { return out.subscribers() == 1; });
    blob picture;
    picture.content.resize(10'000);
    for (int i = 0; i < 300; ++i) { // at once, faster than anything
        out(picture);
        REQUIRE(core->queued() <= 6);
    }
    at.run_until([&] { return *result == 300; }); // each one came, or is counted
    CHECK(core->losses.too_many_bytes >= 200);
}

void newest_only(pair& at) {
    auto out = at.boat.publish(position);
    at.open();
    auto got = sit(at, ise::subscribe_options::keep_latest());
    for (int i = 1; i <= 200; ++i) {
        out(numbered(i));
        if (i % 10 == 0)
            at.run_until([&] {
                return got->counts().received + got->counts().lost_at_provider == static_cast<std::uint64_t>(i);
            });
        if (i % 50 != 0) continue;
        drain(*got); // one, and it is the newest that was published, not the oldest that waited
        CHECK(got->packets.size() == static_cast<std::size_t>(i / 50));
        CHECK(got->last() == i);
    }
    got->check_exact();
}

void too_slow(pair& at) {
    auto out = at.boat.publish(position);
    at.open();
    auto got = sit(at, ise::subscribe_options::disconnect(3));
    for (int i = 1; i <= 4; ++i) out(numbered(i));
    at.run_until([&] { return got->stream->ended(); });
    CHECK(got->stream->cause().code() == errc::overloaded);
    at.run_until([&] { return out.subscribers() == 0; });
    drain(*got);
    CHECK(got->packets.size() <= 3);
}

} // namespace

TEMPLATE_TEST_CASE("lossless with credits loses nothing, however slow the reader, or is refused", "",
                   OVER_EVERY_TRANSPORT) {
    over<TestType>(lossless);
}

TEMPLATE_TEST_CASE("a reader that stalls holds up nobody, and keeps what it asked for", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(stalled_reader);
}

TEMPLATE_TEST_CASE("what waits for a subscriber is bounded in bytes, and what is dropped is counted", "",
                   OVER_EVERY_TRANSPORT) {
    over<TestType>(bounded_bytes, [](ise::service_options& options) { options.session_bytes = 16 * 1024; });
}

TEMPLATE_TEST_CASE("of a state the next packet taken is the newest", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(newest_only);
}

TEMPLATE_TEST_CASE("who wants no gap and is too slow is told that it is over", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(too_slow);
}
