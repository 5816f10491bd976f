#include <ise/call/reply_cache.hpp>
#include <ise/service/session.hpp>
#include <support/catch.hpp>

#include <map>
#include <memory>
#include <random>

namespace reply_window_test {

using namespace std::chrono_literals;
using ise::reply_cache;
using state = ise::reply_cache::state;

namespace {

constexpr ise::time_point now{1000s};
constexpr ise::time_point later{2000s};

reply_cache::place at(std::uint64_t id) {
    reply_cache::place made;
    made.id = id;
    return made;
}
ise::bytes frame_of(std::size_t size) { return ise::bytes(size, std::byte{1}); }

} // namespace

TEST_CASE("a numbered call runs once, and its answer is kept for who asks again") {
    reply_cache window(false);
    CHECK(window.look(5, false) == state::fresh);
    window.begin(5, at(50), later, now);
    CHECK(window.look(5, true) == state::running);
    window.redirect(5, at(60));
    CHECK(window.origin(5)->id == 50);
    CHECK(window.finish(5, frame_of(10), now)->id == 60);
    CHECK(window.look(5, true) == state::answered);
    CHECK(window.answer(5)->size() == 10);
    CHECK_FALSE(window.finish(5, frame_of(10), now)); // once
    CHECK(window.look(4, true) == state::fresh);
}

TEST_CASE("what was given up does not run again") {
    reply_cache window(false);
    window.begin(1, at(1), later, now);
    window.give_up(1);
    CHECK(window.look(1, true) == state::forgotten);
    CHECK_FALSE(window.finish(1, frame_of(1), now));
    CHECK(window.running() == 0);
}

TEST_CASE("replies are bounded by number and by bytes, the ones nobody waits for go first, and none runs twice") {
    reply_cache window(false);
    for (std::uint64_t number = 1; number <= 10 * reply_cache::max_replies; ++number) {
        window.begin(number, at(number), number % 2 ? later : now, now + 1ns);
        window.finish(number, frame_of(100), now);
        REQUIRE(window.replies() <= reply_cache::max_replies);
        REQUIRE(window.look(number, true) == state::answered);
    }
    CHECK(window.look(1, true) == state::forgotten);
    for (std::uint64_t number = 20'000; number < 20'100; ++number) {
        window.begin(number, at(number), later, now);
        window.finish(number, frame_of(1 << 20), now);
        REQUIRE(window.reply_bytes() <= reply_cache::max_reply_bytes + (1 << 20));
    }
    // Numbers with gaps between them: the lowest are taken for seen in the end.
    for (std::uint64_t number = 100'000; number < 110'000; number += 2) {
        window.begin(number, at(number), later, now);
        window.give_up(number);
    }
    CHECK(window.look(99'999, false) == state::forgotten);
    CHECK(window.look(109'997, false) == state::fresh);
}

TEST_CASE("answers that come late, with nothing begun behind them, are bounded too, and what runs is never forgotten") {
    reply_cache window(false);
    for (std::uint64_t number = 1; number <= 64; ++number) window.begin(number, at(number), later, now);
    for (std::uint64_t number = 1; number <= 64; ++number) {
        REQUIRE(window.look(number, true) == state::running);
        REQUIRE(window.finish(number, frame_of(1 << 20), now));
        REQUIRE(window.look(number, true) == state::answered);
        REQUIRE(window.reply_bytes() <= reply_cache::max_reply_bytes + (1 << 20));
        REQUIRE(window.running() == 64 - number);
    }
    CHECK(window.look(1, true) == state::forgotten);
    for (std::uint64_t number = 1001; number <= 3000; ++number) window.begin(number, at(number), later, now);
    for (std::uint64_t number = 1001; number <= 3000; ++number) {
        window.finish(number, frame_of(1), now);
        REQUIRE(window.replies() <= reply_cache::max_replies);
    }
}

TEST_CASE("gaps in the numbers of one link leave those of an older link as they are") {
    reply_cache window(false);
    const std::uint64_t older = 1ull << 40, newer = 2ull << 40;
    window.begin(older + 1, at(1), later, now);
    for (std::uint64_t i = 0; i < reply_cache::max_gaps + 6; ++i) window.begin(newer + 1 + 2 * i, at(i), later, now);
    CHECK(window.look(older + 1, true) == state::running);
    CHECK(window.look(older + 2, false) == state::fresh);
    CHECK(window.look(older + 2, true) == state::fresh);
    window.give_up(older + 1);
    CHECK(window.look(older + 1, true) == state::forgotten);
    CHECK(window.look(newer + 2, false) == state::forgotten);
}

TEST_CASE("a client with several links counts in several ranges, and nothing of one is taken for another's") {
    // What is told of each number, kept in the plainest way; few enough that nothing has to give way.
    struct result {
        std::uint64_t from = 0, to = 0;
        std::optional<std::size_t> answered;
    };
    std::map<std::uint64_t, result> expected;
    std::map<std::uint64_t, bool> given_up;
    std::mt19937_64 random(4);
    reply_cache window(false);
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
                auto to = window.finish(number, frame, now);
                REQUIRE(to.has_value() == runs);
                if (runs) REQUIRE(to->id == known->second.to);
                if (runs) known->second.answered = frame.size();
            }
        }
        if (step % 50 != 0) continue;
        std::size_t replies = 0, reply_bytes = 0;
        for (auto number : begun) {
            auto known = expected.find(number);
            auto is = known == expected.end()  ? state::forgotten
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

TEST_CASE("a client that has had many links is known by the latest, and what may have run over an earlier one does not "
          "run again") {
    reply_cache window(false);
    auto number = [](std::uint64_t link, std::uint64_t call) { return (link << reply_cache::range_bits) + call; };
    for (std::uint64_t link = 1; link <= 2 * reply_cache::max_ranges; ++link) {
        window.begin(number(link, 1), at(1), later, now);
        window.give_up(number(link, 1));
        REQUIRE(window.look(number(link, 1), true) == state::forgotten);
        REQUIRE(window.look(number(link, 2), true) == state::fresh);
    }
    CHECK(window.look(number(1, 1), true) == state::forgotten);
    CHECK(window.look(number(1, 2), false) == state::fresh);
    window.begin(number(1, 2), at(1), later, now);
    window.give_up(number(1, 2));
    CHECK(window.look(number(1, 1), true) == state::forgotten);
    CHECK(window.look(number(2 * reply_cache::max_ranges, 2), true) == state::fresh);
}

TEST_CASE("answers of all clients together are bounded, and who called least recently loses its own") {
    ise::reply_windows windows;
    std::vector<std::shared_ptr<reply_cache>> held;
    auto call = [&](std::uint64_t client, ise::time_point when) {
        auto window = windows.of(client, 7, when);
        for (std::uint64_t number = 1; number <= 4; ++number) window->begin(number, at(number), later, when);
        for (std::uint64_t number = 1; number < 4; ++number) { // one runs on
            window->finish(number, frame_of(1 << 20), when);
            windows.tidy(when);
            REQUIRE(windows.room() <= ise::reply_windows::max_kept_bytes);
        }
        return window;
    };
    bool with_session = GENERATE(false, true);
    for (std::uint64_t client = 1; client <= 200; ++client) {
        auto window = call(client, now + ise::duration(client));
        if (with_session) held.push_back(window);
    }
    CHECK(windows.size() == 200);
    for (std::uint64_t client = 1; client <= 200; ++client) {
        auto window = windows.of(client, 7, now + 1s);
        CHECK(window->look(4, true) == state::running);
        if (client <= 180) CHECK(window->look(1, true) == state::forgotten);
        if (client > 185) CHECK(window->look(1, true) == state::answered);
    }
    for (std::uint64_t client = 1; client <= 200; ++client) windows.of(client, 7, now)->forget_answers();
    CHECK(windows.room() < 200'000);
}

TEST_CASE("what is idle loses its answers by and by, without new clients, and what was called stays known") {
    ise::reply_windows windows;
    for (std::uint64_t client = 1; client <= 10; ++client) {
        auto window = windows.of(client, 7, now);
        window->begin(1, at(1), later, now);
        window->finish(1, frame_of(1 << 20), now);
    }
    auto mine = windows.of(99, 7, now);
    auto call = [&](std::uint64_t number, ise::time_point when) {
        mine->begin(number, at(number), later, when);
        mine->finish(number, frame_of(100), when);
        windows.tidy(when);
    };
    call(1, now + 1min);
    CHECK(windows.room() > 10u << 20);
    call(2, now + ise::reply_windows::idle_caller_life + 1min);
    CHECK(windows.room() < 1000);
    CHECK(mine->look(2, true) == state::answered);
    CHECK(windows.of(1, 7, now)->look(1, true) == state::forgotten);
    CHECK(windows.of(1, 7, now)->look(2, true) == state::fresh);
}

TEST_CASE("where a window of the client may have been dropped, what it repeats is refused and what is new is not") {
    ise::reply_windows windows;
    std::vector<std::shared_ptr<reply_cache>> held;
    auto mine = windows.of(1, 7, now);
    mine->begin(7, at(1), later, now);
    mine->give_up(7);
    mine.reset();
    for (std::uint64_t client = 2; client < 5000; ++client) windows.of(client, 7, now + 1h);
    CHECK(windows.size() < 4000);
    auto again = windows.of(1, 7, now + 1h);
    CHECK(again->look(7, true) == state::forgotten);
    CHECK(again->look(8, true) == state::forgotten);
    CHECK(again->look(8, false) == state::fresh);
}

} // namespace reply_window_test
