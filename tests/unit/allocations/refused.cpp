// What is left where memory has run out.
#include "counting.hpp"

#include <ise/call/reply_cache.hpp>
#include <ise/service/session.hpp>
#include <support/catch.hpp>

#include <new>

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

} // namespace refused_test
