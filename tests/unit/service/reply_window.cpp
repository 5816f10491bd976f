#include <ise/service/reply_window.hpp>
#include <ise/service/session.hpp>
#include <support/catch.hpp>

#include <memory>

using namespace std::chrono_literals;
using ise::reply_window;
using state = ise::reply_window::state;

namespace {

constexpr ise::time_point now{1000s};
constexpr ise::time_point later{2000s};

reply_window::place at(std::uint64_t id) {
    reply_window::place made;
    made.id = id;
    return made;
}
ise::bytes frame_of(std::size_t size) { return ise::bytes(size, std::byte{1}); }

} // namespace

TEST_CASE("a numbered call runs once, and its answer is kept for who asks again") {
    reply_window window(false);
    CHECK(window.look(5, false) == state::fresh);
    window.begin(5, at(50), later, now);
    CHECK(window.look(5, true) == state::running);
    window.redirect(5, at(60));
    CHECK(window.origin(5)->id == 50);
    CHECK(window.finish(5, frame_of(10))->id == 60);
    CHECK(window.look(5, true) == state::answered);
    CHECK(window.answer(5)->size() == 10);
    CHECK_FALSE(window.finish(5, frame_of(10))); // once
    CHECK(window.look(4, true) == state::fresh);
}

TEST_CASE("what was given up does not run again") {
    reply_window window(false);
    window.begin(1, at(1), later, now);
    window.give_up(1);
    CHECK(window.look(1, true) == state::forgotten);
    CHECK_FALSE(window.finish(1, frame_of(1)));
    CHECK(window.running() == 0);
}

TEST_CASE("replies are bounded by number and by bytes, the ones nobody waits for go first, and none runs twice") {
    reply_window window(false);
    for (std::uint64_t number = 1; number <= 10 * reply_window::max_replies; ++number) {
        window.begin(number, at(number), number % 2 ? later : now, now + 1ns);
        window.finish(number, frame_of(100));
        REQUIRE(window.replies() <= reply_window::max_replies);
        REQUIRE(window.look(number, true) == state::answered);
    }
    CHECK(window.look(1, true) == state::forgotten);
    for (std::uint64_t number = 20'000; number < 20'100; ++number) {
        window.begin(number, at(number), later, now);
        window.finish(number, frame_of(1 << 20));
        REQUIRE(window.reply_bytes() <= reply_window::max_reply_bytes + (1 << 20));
    }
    // Numbers with gaps between them: the lowest are taken for seen in the end.
    for (std::uint64_t number = 100'000; number < 110'000; number += 2) {
        window.begin(number, at(number), later, now);
        window.give_up(number);
    }
    CHECK(window.look(99'999, false) == state::forgotten);
    CHECK(window.look(109'997, false) == state::fresh);
}

TEST_CASE("where a window of the client may have been dropped, what it repeats is refused and what is new is not") {
    ise::reply_windows windows;
    std::vector<std::shared_ptr<reply_window>> held;
    auto mine = windows.of(1, now);
    mine->begin(7, at(1), later, now);
    mine->give_up(7);
    mine.reset();
    for (std::uint64_t client = 2; client < 5000; ++client) windows.of(client, now + 1h);
    CHECK(windows.size() < 4000);
    auto again = windows.of(1, now + 1h);
    CHECK(again->look(7, true) == state::forgotten);
    CHECK(again->look(8, true) == state::forgotten);
    CHECK(again->look(8, false) == state::fresh);
}
