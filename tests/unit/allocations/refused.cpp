// The state after an allocation has failed, and allocations that a peer cannot cause.
#include "counting.hpp"

#include <ise/call/reply_cache.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/core/sleep.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/service/session.hpp>
#include <ise/wire/pieces.hpp>
#include <support/catch.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/io_context.hpp>

#include <memory>
#include <new>
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
