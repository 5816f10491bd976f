#include <ise/service/reply_window.hpp>
#include <ise/service/session.hpp>
#include <support/catch.hpp>

#include <map>
#include <memory>
#include <random>

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

TEST_CASE("a client with several links counts in several ranges, and nothing of one is taken for another's") {
    // What is told of each number, kept in the plainest way; few enough that nothing has to give way.
    struct told {
        std::uint64_t from = 0, to = 0;
        std::optional<std::size_t> answered;
    };
    std::map<std::uint64_t, told> expected;
    std::map<std::uint64_t, bool> given_up;
    std::mt19937_64 random(4);
    reply_window window(false);
    std::uint64_t next[] = {1, (1ull << 40) + 1, (2ull << 40) + 1};
    std::vector<std::uint64_t> begun;
    for (std::uint64_t step = 0; step < 5000; ++step) {
        const auto what = random() % 8;
        if (what < 3 && expected.size() < 900) {
            const auto number = next[random() % 3]++ + (random() % 16 == 0 ? 1000 : 0); // some leave gaps
            if (!expected.contains(number) && !given_up[number]) {
                window.begin(number, at(number + 7), later, now);
                expected[number] = {number + 7, number + 7, {}};
                begun.push_back(number);
            }
        } else if (!begun.empty()) {
            const auto number = begun[random() % begun.size()];
            auto known = expected.find(number);
            const bool runs = known != expected.end() && !known->second.answered;
            if (what < 4) {
                window.redirect(number, at(step));
                if (runs) known->second.to = step;
            } else if (what < 5) {
                window.give_up(number);
                if (known != expected.end()) expected.erase(known);
                given_up[number] = true;
            } else {
                const auto frame = frame_of(1 + random() % 2000);
                auto to = window.finish(number, frame);
                REQUIRE(to.has_value() == runs);
                if (runs) REQUIRE(to->id == known->second.to);
                if (runs) known->second.answered = frame.size();
            }
        }
        if (step % 50 != 0) continue;
        std::size_t replies = 0, reply_bytes = 0;
        for (auto number : begun) {
            auto known = expected.find(number);
            auto is = known == expected.end()      ? state::forgotten
                      : known->second.answered ? state::answered
                                               : state::running;
            REQUIRE(window.look(number, true) == is);
            REQUIRE(window.origin(number).has_value() == (is == state::running));
            REQUIRE((window.answer(number) != nullptr) == (is == state::answered));
            if (is == state::running) REQUIRE(window.origin(number)->id == known->second.from);
            if (is != state::answered) continue;
            REQUIRE(window.answer(number)->size() == *known->second.answered);
            ++replies;
            reply_bytes += *known->second.answered;
        }
        REQUIRE(window.replies() == replies);
        REQUIRE(window.reply_bytes() == reply_bytes);
        REQUIRE(window.running() == expected.size() - replies);
    }
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
