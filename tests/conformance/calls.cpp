// The table "What is guaranteed over which transport" of ise/wire/FORMAT.md, row by row: calls.
#include "traffic.hpp"

#include <fmt/format.h>

#include <algorithm>

using namespace conformance;

namespace {

void overtaking(pair& at) {
    at.boat.provide(helm, [&](set_mode asked) -> ise::task<mode_set> {
        if (asked.mode == "slow") co_await ise::sleep_for(at.boat.on, 100ms);
        mode_set answer{true, asked.mode};
        co_return answer;
    });
    at.boat.provide(echo, [](blob given) { return given; });
    at.open();
    auto slow = begin_helm(at, "slow", 10s);
    auto quick = begin_helm(at, "quick", 10s);
    at.run_until([&] { return quick->done; });
    CHECK_FALSE(slow->done);
    at.run_until([&] { return slow->done; });
    CHECK((quick->get()->reason == "quick" && slow->get()->reason == "slow"));

    auto big = start(at.shore.on, try_echo(at.there, at.has.big_message));
    int between = 0;
    while (!big->done) {
        auto got = at.run(try_helm(at.there, "quick", 30s));
        INFO((got ? std::string() : got.error().message()));
        REQUIRE(got);
        ++between;
    }
    REQUIRE(big->get());
    CHECK(big->get()->content.size() == at.has.big_message);
    CHECK(big->get()->content[100'001] == static_cast<std::uint8_t>(100'001 * 7));
    CHECK(between >= at.has.calls_beside_big); // it held up none
}

void at_most_once(pair& at) {
    auto runs = std::make_shared<std::map<std::string, int>>();
    at.boat.provide(helm, [runs](set_mode asked) {
        ++(*runs)[asked.mode];
        return mode_set{true, asked.mode};
    });
    at.open();
    REQUIRE(at.run(try_helm(at.there, "first", 10s)));
    for (int round = 0; round < 10; ++round) {
        std::vector<call> calls;
        for (int i = 0; i < 20; ++i) calls.push_back(begin_helm(at, fmt::format("{}.{}", round, i), 30s));
        int turns = 0;
        at.run_until([&] { return ++turns > round; });
        at.cut();
        at.run_until([&] { return std::ranges::all_of(calls, [](auto& one) { return one->done; }); });
        for (int i = 0; i < 20; ++i) {
            auto& got = calls[static_cast<std::size_t>(i)]->get();
            auto ran = (*runs)[fmt::format("{}.{}", round, i)];
            CHECK(ran <= 1);
            if (got) CHECK(ran == 1);
            if (at.has.calls_are_repeated) CHECK(got);
            if (!got && got.error().executed() == execution::not_executed) CHECK(ran == 0);
        }
    }
    REQUIRE(at.run(try_helm(at.there, "last", 30s)));
}

// Handlers that end when the test says so, and count what becomes of them.
struct handlers {
    int begun = 0, cancelled = 0;
    bool may_end = false;
};
std::shared_ptr<handlers> waiting_helm(side& boat) {
    auto all = std::make_shared<handlers>();
    boat.provide(helm, [all, &boat](set_mode asked) -> ise::task<mode_set> {
        ++all->begun;
        try {
            while (!all->may_end) co_await ise::sleep_for(boat.on, 5ms);
        } catch (const std::exception&) {
            ++all->cancelled;
            throw;
        }
        mode_set answer{true, asked.mode};
        co_return answer;
    });
    return all;
}

void going_on(pair& at) {
    auto handler = waiting_helm(at.boat);
    at.open();
    auto lasting = begin_helm(at, "lasting", 1h);
    at.run_until([&] { return handler->begun == 1; });
    at.cut();
    if (!at.has.calls_are_repeated) {
        at.run_until([&] { return lasting->done; });
        REQUIRE_FALSE(lasting->get());
        CHECK(lasting->get().error().code() == errc::peer_lost);
        CHECK(lasting->get().error().executed() == execution::unknown);
    } else { // it is asked for again over another session, where the answer comes
        at.run_until([&] {
            return at.boat.services->counts().sessions_accepted == 2 && at.boat.services->sessions().size() == 1;
        });
        CHECK_FALSE(lasting->done);
        handler->may_end = true;
        at.run_until([&] { return lasting->done; });
        REQUIRE(lasting->get());
        CHECK(lasting->get()->reason == "lasting");
        CHECK(handler->cancelled == 0);
    }
    CHECK(handler->begun == 1);
}

// In another life of the provider nobody asks for it again: nobody knows there whether it has run.
void not_in_another_life(pair& at) {
    auto handler = waiting_helm(at.boat);
    at.open();
    auto lasting = begin_helm(at, "lasting", 1h);
    at.run_until([&] { return handler->begun == 1; });
    auto& next = at.next_life();
    auto again = waiting_helm(next);
    again->may_end = true;
    at.listen_again();
    at.run_until([&] { return lasting->done; });
    REQUIRE_FALSE(lasting->get());
    CHECK(lasting->get().error().code() == errc::peer_lost);
    CHECK(lasting->get().error().executed() == execution::unknown);
    CHECK(at.run(try_helm(at.there, "anew", 1h)));
    CHECK((handler->begun == 1 && again->begun == 1));
}

void told_to_the_handler(pair& at) {
    auto handler = waiting_helm(at.boat);
    at.open();
    auto late = at.run(try_helm(at.there, "x", 200ms));
    REQUIRE_FALSE(late);
    CHECK(late.error().code() == errc::timed_out);
    at.run_until([&] { return handler->cancelled == handler->begun; });
    auto before = handler->begun;
    auto given_up = begin_helm(at, "y", 1h);
    at.run_until([&] { return handler->begun == before + 1; });
    given_up->cancel.emit(asio::cancellation_type::terminal);
    at.run_until([&] { return given_up->done && handler->cancelled == handler->begun; });
    CHECK(handler->cancelled == handler->begun);
}

// The caller is out of reach, for good.
void loses_its_caller(pair& at, ise::duration deadline) {
    auto handler = waiting_helm(at.boat);
    if (at.has.relay_at.empty()) at.open();
    else at.open_through_relay();
    auto begun = at.boat.on.now();
    auto asked = begin_helm(at, "x", deadline);
    at.run_until([&] { return handler->begun == 1; });
    if (at.between) at.part(true);
    else at.cut();
    at.run_until([&] { return at.boat.services->sessions().empty(); });
    auto ended = at.boat.on.now();
    if (at.has.calls_are_repeated) CHECK(handler->cancelled == 0); // he may come back
    at.run_until([&] { return handler->cancelled == 1; });
    auto expected =
        at.has.calls_are_repeated ? std::min(ended + at.boat.services->options().linger, begun + deadline) : ended;
    INFO(fmt::format("{} ms",
                     std::chrono::duration_cast<std::chrono::milliseconds>(at.boat.on.now() - expected).count()));
    // A deadline is told as the earliest time that it can be at the provider.
    if (at.over.is_virtual()) CHECK((at.boat.on.now() >= expected - 100ms && at.boat.on.now() <= expected + 200ms));
    CHECK(handler->begun == 1);
    if (at.between) at.part(false);
    at.run_until([&] { return asked->done; });
    CHECK_FALSE(asked->get());
}

// The provider's thread is busy for that long.
void compute(side& who, ise::duration length) {
    if (who.env.is_virtual()) {
        auto& engine = static_cast<ise::sim::process&>(who.env).host().world().engine();
        engine.advance_to(engine.now() + length);
        return;
    }
    const auto until = who.env.now() + length;
    while (who.env.now() < until) {}
}

// Those that wait behind the first ones, in the kernel, on the way or here, find their deadline past.
void expired(pair& at) {
    int begun = 0;
    at.boat.provide(helm, [&](set_mode asked) {
        ++begun;
        compute(at.boat, asked.mode == "hard" ? 300ms : 0ms);
        return mode_set{true, asked.mode};
    });
    at.boat.provide(echo, [&](blob given) -> ise::task<blob> {
        ++begun;
        compute(at.boat, given.content.empty() ? 0ms : 300ms);
        co_return given;
    });
    at.open();
    REQUIRE(at.run(try_helm(at.there, "easy", 10s)));
    for (bool coroutines : {false, true}) {
        begun = 0;
        std::vector<call> calls;
        std::vector<std::shared_ptr<started<ise::result<blob>>>> echoes;
        for (int i = 0; i < 10; ++i) {
            if (coroutines) echoes.push_back(start(at.shore.on, try_echo(at.there, 10, 700ms)));
            else calls.push_back(begin_helm(at, "hard", 700ms));
        }
        at.run_until([&] {
            return std::ranges::all_of(calls, [](const auto& one) { return one->done; }) &&
                   std::ranges::all_of(echoes, [](const auto& one) { return one->done; });
        });
        at.run(try_helm(at.there, "easy", 10s)).value(); // behind all of them
        CHECK(begun >= 2);
        CHECK(begun <= 4); // the third is begun in time, and the last one counted is the easy one
    }
    CHECK(at.boat.services->counts().calls_expired > 0);
}

void too_large(pair& at) {
    at.boat.provide(echo, [](blob given) { return given; });
    at.boat.provide(helm, [](set_mode) { return mode_set{true, "still here"}; });
    at.open();
    REQUIRE(at.run(try_helm(at.there, "x", 10s)));
    auto most = at.there.way().current()->wire().terms().peer_accepts.max_message_bytes;
    CHECK(most == at.has.message_limit);
    auto refused = at.run(try_echo(at.there, static_cast<std::size_t>(most)));
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == errc::too_large);
    CHECK(refused.error().executed() == execution::not_executed);
    CHECK(refused.error().message().find(fmt::format("{}", most)) != std::string::npos);
    CHECK(at.run(try_helm(at.there, "x", 10s)));
}

} // namespace

TEMPLATE_TEST_CASE("a call is answered, small or big, and concurrent calls overtake each other", "",
                   OVER_EVERY_TRANSPORT) {
    over<TestType>(overtaking);
}

TEMPLATE_TEST_CASE("a request runs at most once, whatever becomes of the session", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(at_most_once);
}

TEMPLATE_TEST_CASE("a call whose session is lost while it runs goes on over the next one, or its outcome is unknown",
                   "", OVER_EVERY_TRANSPORT) {
    over<TestType>(going_on);
}

TEMPLATE_TEST_CASE("a call does not go on in another life of the provider", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(not_in_another_life);
}

TEMPLATE_TEST_CASE("deadline and cancellation reach the handler", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(told_to_the_handler);
}

TEMPLATE_TEST_CASE("a handler is cancelled when the session of its caller ends, over udp with the linger", "",
                   OVER_EVERY_TRANSPORT) {
    over<TestType>([](pair& at) { loses_its_caller(at, 1h); },
                   [](ise::service_options& options) { options.linger = 2s; });
}

TEMPLATE_TEST_CASE("over udp a handler is cancelled at its deadline where that comes before the linger is over", "",
                   OVER_DATAGRAMS) {
    auto tune = [](ise::service_options& options) {
        options.linger = 1h;
        options.accepts.heartbeat_ns = 100'000'000;
    };
    over<TestType>([](pair& at) { loses_its_caller(at, 3s); }, tune);
}

TEMPLATE_TEST_CASE("an expired request is not started, wherever it waited", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(expired);
}

TEMPLATE_TEST_CASE("a message beyond the limit is refused with its size and the limit", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(too_large);
}
