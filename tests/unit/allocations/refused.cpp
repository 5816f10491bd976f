// The state after an allocation has failed, and allocations that a peer cannot cause.
#include "counting.hpp"

#include <ise/asio.hpp>
#include <ise/call/reply_cache.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/core/sleep.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/service/session.hpp>
#include <ise/wire/pieces.hpp>
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/io_context.hpp>

#include <map>
#include <memory>
#include <new>
#include <optional>
#include <vector>

namespace refused_test {

using namespace ise_test;
using namespace std::chrono_literals;
using ise::reply_cache;

TEST_CASE("a reply window that any allocation was refused goes on, and nothing of it runs twice") {
    constexpr ise::time_point now{1000s};
    const ise::bytes frame(600, std::byte{1});
    for (std::int64_t n = 0;; ++n) {
        CAPTURE(n);
        reply_cache window(false);
        bool refused = false;
        std::uint64_t begun = 0;
        refuse_allocation_after(n);
        try {
            for (std::uint64_t number = 1; number <= 20; ++number) {
                window.begin(number * 2, reply_cache::place(), now + 1h, now);
                begun = number;
                if (number % 3 == 0) window.give_up(number * 2);
                if (number % 3 == 1) window.finish(number * 2, frame, now);
            }
        } catch (const std::bad_alloc&) {
            refused = true;
        }
        refuse_no_allocation();
        for (std::uint64_t number = 1; number <= begun; ++number)
            REQUIRE(window.look(number * 2, true) != reply_cache::state::fresh);
        for (std::uint64_t number = 101; number <= 150; ++number) {
            window.begin(number, reply_cache::place(), now + 1h, now);
            REQUIRE(window.look(number, true) == reply_cache::state::running);
            REQUIRE(window.finish(number, frame, now));
            REQUIRE(*window.answer(number) == frame);
        }
        window.forget_answers();
        REQUIRE(window.replies() == 0);
        REQUIRE(window.reply_bytes() == 0);
        if (!refused) break;
    }
}

namespace {

ise::task<> wait_long(ise::loop& on) { co_await ise::sleep_for(on, 1h); }

} // namespace

TEST_CASE("a loop and its coroutines go on after any allocation was refused") {
    for (std::int64_t n = 0;; ++n) {
        CAPTURE(n);
        ise::real_environment env;
        asio::io_context io;
        auto host = env.adopt(asio::any_io_executor(io.get_executor()), true);
        auto& on = host->loop();
        ise::task_scope scope(on, [](const std::string&, std::exception_ptr) {});
        bool refused = false;
        {
            std::vector<std::unique_ptr<ise::timer>> timers;
            for (int at = 0; at < 20; ++at) timers.push_back(std::make_unique<ise::timer>(on, [] {}));
            refuse_allocation_after(n);
            try {
                for (auto& one : timers) one->arm(on.now() + 1h);
                for (int started = 0; started < 20; ++started) scope.spawn("waits", wait_long(on));
            } catch (const std::bad_alloc&) {
                refused = true;
            }
            refuse_no_allocation();
        }
        scope.stop();
        for (int round = 0; round < 1000 && scope.size() > 0; ++round) io.poll_one();
        CHECK(scope.size() == 0);
        host->end();
        if (!refused) break;
    }
}

namespace {

using boat_services::blob;
using boat_services::echo;
constexpr ise::request_response<blob, blob> other("other");

template <class Contract>
ise::task<> ask_once(ise::remote to, Contract of) {
    typename Contract::request_type request;
    auto got = co_await to.call(of, std::move(request), 5s);
    static_cast<void>(got);
}

struct called {
    int ends = 0;
    std::optional<ise::result<blob>> last;
};

// Calls of the given sizes in one turn, of which one is refused an allocation. False: it threw, and has no outcome.
ise::task<bool> call_all(ise::loop& on, ise::remote to, const std::vector<std::size_t>& sizes, std::size_t refused,
                         std::int64_t n, std::vector<called>& into) {
    bool begun = true;
    into.resize(sizes.size());
    ise::loop::turn in(on);
    for (std::size_t at = 0; at < sizes.size(); ++at) {
        blob request;
        request.content.assign(sizes[at], static_cast<std::uint8_t>(at));
        auto note = [&one = into[at]](ise::result<blob> outcome) {
            ++one.ends;
            one.last.emplace(std::move(outcome));
        };
        if (at == refused) refuse_allocation_after(n);
        try {
            to.try_call(echo, std::move(request), 5s, std::move(note));
        } catch (const std::bad_alloc&) {
            begun = false;
        }
        refuse_no_allocation();
    }
    co_return begun;
}

} // namespace

TEST_CASE("a call that any allocation was refused ends once, and the calls beside it get their own answers") {
    // Without a session, with one, and with one over which the service was called before.
    const bool connected = GENERATE(true, false), called_before = GENERATE(true, false);
    if (called_before && !connected) return;
    // Small ones side by side, one that goes in pieces behind them, and one that fills a block.
    const std::vector<std::size_t> sizes{100, 70'000, 200'000, 300};
    int failed = 0;
    for (std::int64_t step = 0; step < 160; ++step) {
        const std::size_t refused = static_cast<std::size_t>(step) % 4;
        const std::int64_t n = step / 4;
        CAPTURE(connected, called_before, refused, n);
        sim_parties all;
        auto& boat = all.add("boat");
        auto& shore = all.add("shore");
        boat.provide(echo, [](blob given) { return given; });
        boat.provide(other, [](blob given) { return given; });
        boat.listen("tcp://0.0.0.0:7400");
        auto there = shore.at("tcp://boat:7400");
        std::vector<called> first, all_of, last;
        {
            std::vector<std::unique_ptr<ise::timer>> alarms; // the loop's room for timers
            for (int i = 0; i < 100; ++i)
                alarms.emplace_back(std::make_unique<ise::timer>(shore.on, [] {}))->arm(shore.on.now() + 1h);
        }
        if (connected) all.run(shore, ask_once(there, other));
        if (called_before) {
            all.run(shore, call_all(shore.on, there, sizes, sizes.size(), 0, first));
            all.world.run_for(1s);
        }
        const bool begun = all.run(shore, call_all(shore.on, there, sizes, refused, n, all_of));
        all.world.run_for(1s);
        all.run(shore, call_all(shore.on, there, sizes, sizes.size(), 0, last));
        all.world.run_for(10s); // also all deadlines
        for (std::size_t at = 0; at < sizes.size(); ++at) {
            CAPTURE(at);
            REQUIRE(last[at].ends == 1);
            REQUIRE(last[at].last->value().content == std::vector<std::uint8_t>(sizes[at], std::uint8_t(at)));
            REQUIRE(all_of[at].ends == (at == refused && !begun ? 0 : 1));
            if (at != refused) REQUIRE(*all_of[at].last);
            if (!all_of[at].last) continue;
            if (*all_of[at].last)
                REQUIRE(all_of[at].last->value().content == std::vector<std::uint8_t>(sizes[at], std::uint8_t(at)));
            else ++failed;
        }
        REQUIRE(shore.services->calls().open_calls() == 0);
        REQUIRE(all.stop());
    }
    CHECK(failed > 0);
}

namespace {

// Calls of which nothing has been written when their session ends, where a buffer is refused memory.
ise::task<> call_and_cut(party& by, ise::remote to, std::int64_t n, std::vector<called>& into) {
    into.resize(4);
    ise::loop::turn in(by.on);
    for (std::size_t at = 0; at < into.size(); ++at) {
        blob request;
        request.content.assign(100, static_cast<std::uint8_t>(at));
        to.try_call(echo, std::move(request), 5s, [&one = into[at]](ise::result<blob> outcome) {
            ++one.ends;
            one.last.emplace(std::move(outcome));
        });
    }
    for (const auto& [raw, held] : std::map(by.services->sessions()))
        held->wire().close(ise::failure(ise::errc::peer_lost, "cut")); // it is reported behind this
    by.on.later([] { refuse_no_growth(); });
    refuse_growth_after(n);
    co_return;
}

} // namespace

TEST_CASE("a call that finds no memory to wait for the next session fails, and the others wait") {
    int failed = 0;
    for (std::int64_t n = 0; n < 8; ++n) {
        CAPTURE(n);
        sim_parties all;
        auto& boat = all.add("boat");
        auto& shore = all.add("shore");
        boat.provide(echo, [](blob given) { return given; });
        boat.listen("tcp://0.0.0.0:7400");
        auto there = shore.at("tcp://boat:7400");
        all.run(shore, ask_once(there, echo));
        std::vector<called> all_of;
        all.run(shore, call_and_cut(shore, there, n, all_of));
        all.world.run_for(10s);
        refuse_no_growth();
        int of_these = 0;
        for (std::size_t at = 0; at < all_of.size(); ++at) {
            CAPTURE(at);
            REQUIRE(all_of[at].ends == 1);
            if (*all_of[at].last)
                CHECK(all_of[at].last->value().content ==
                      std::vector<std::uint8_t>(100, static_cast<std::uint8_t>(at)));
            else ++of_these;
        }
        CHECK(of_these <= 1);
        failed += of_these;
        REQUIRE(shore.services->calls().open_calls() == 0);
        REQUIRE(all.stop());
    }
    CHECK(failed > 0);
}

TEST_CASE("a long message gets room as its bytes come, not as it is announced") {
    using namespace ise::wire;
    constexpr std::uint64_t announced = 200 << 20;
    reassembly in(announced);
    ise::buffer body;
    piece_head{frame_type::request, 0, 1, announced}.put(body);
    frame part;
    part.header.type = frame_type::piece;
    part.header.id = 1;
    part.header.length = 1 << 20; // of which nothing comes at first
    part.body = body.view();
    take_largest_reallocation();
    REQUIRE(in.begin(part).value());
    CHECK(take_largest_reallocation() <= part.header.length + frame_header::size);
    for (std::uint64_t come = 0; come < announced / 2;) {
        come += in.missing();
        in.fill(in.missing()).value();
        part.body = {};
        REQUIRE(in.begin(part).value());
        CHECK(take_largest_reallocation() <= 16 * come + frame_header::size);
    }
}

} // namespace refused_test
