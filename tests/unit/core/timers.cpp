// The timers of a loop against a model that has none of their short cuts.
#include "inproc_threads.hpp"

#include <ise/core/loop.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <optional>
#include <random>
#include <vector>

namespace timers_test {

namespace {

using namespace std::chrono_literals;

struct set_clock final : threads::bare_environment {
    ise::time_point at{};
    ise::time_point now() const override { return at; }
};

struct alarm_log final : ise::alarm {
    explicit alarm_log(std::optional<ise::time_point>& at) : armed_at(at) {}
    void arm(ise::time_point at) override { armed_at = at; }
    std::optional<ise::time_point>& armed_at;
};

struct fixture {
    set_clock clock;
    asio::io_context io;
    std::optional<ise::time_point> alarm_at; // what the loop asked to be woken at
    ise::loop loop{clock, io.get_executor(), [] { return true; }};
    fixture() { loop.use_alarm(std::make_unique<alarm_log>(alarm_at)); }

    // As the real alarm does: the loop is woken whenever it asked for it.
    void run_until(ise::time_point end) {
        while (alarm_at && *alarm_at <= end) {
            clock.at = std::max(clock.at, *alarm_at);
            alarm_at.reset();
            loop.on_alarm();
        }
        clock.at = end;
    }
};

ise::time_point at(int ticks) { return ise::time_point(std::chrono::milliseconds(ticks)); }

} // namespace

TEST_CASE("timers that are armed, moved and disarmed at random fire as a sorted list of them would") {
    fixture one;
    std::vector<int> fired;
    struct entry {
        int due = 0;
        int order = 0;
        bool armed = false;
    };
    constexpr int count = 24;
    std::vector<entry> model(count);
    std::vector<std::unique_ptr<ise::timer>> timers;
    for (int i = 0; i < count; ++i)
        timers.push_back(std::make_unique<ise::timer>(one.loop, [&fired, i] { fired.push_back(i); }));

    std::mt19937 random(7);
    auto below = [&random](int limit) { return static_cast<int>(random() % static_cast<unsigned>(limit)); };
    int now = 0, order = 0;
    for (int step = 0; step < 20'000; ++step) {
        int which = below(count);
        auto& known = model[static_cast<std::size_t>(which)];
        auto& timer = *timers[static_cast<std::size_t>(which)];
        switch (below(8)) {
            case 0:
            case 1:
            case 2:
            case 3:
            case 4: // few instants, so that many fall together
                known = entry{now + 1 + below(12), order++, true};
                timer.arm(at(known.due));
                break;
            case 5:
                known.armed = false;
                timer.disarm();
                break;
            case 6: // destroyed wherever it is listed
                known.armed = false;
                timers[static_cast<std::size_t>(which)] =
                    std::make_unique<ise::timer>(one.loop, [&fired, which] { fired.push_back(which); });
                break;
            default: {
                now += 1 + below(6);
                std::vector<int> expected;
                for (int i = 0; i < count; ++i)
                    if (model[static_cast<std::size_t>(i)].armed && model[static_cast<std::size_t>(i)].due <= now)
                        expected.push_back(i);
                std::sort(expected.begin(), expected.end(), [&model](int a, int b) {
                    const auto& x = model[static_cast<std::size_t>(a)];
                    const auto& y = model[static_cast<std::size_t>(b)];
                    return x.due != y.due ? x.due < y.due : x.order < y.order;
                });
                for (int i : expected) model[static_cast<std::size_t>(i)].armed = false;
                fired.clear();
                if (below(3) == 0) one.clock.at = at(now); // the loop comes late, and finds all of it due at once
                one.run_until(at(now));
                REQUIRE(fired == expected);
                REQUIRE(one.loop.armed_timers() ==
                        static_cast<std::size_t>(
                            std::count_if(model.begin(), model.end(), [](const entry& e) { return e.armed; })));
            }
        }
    }
}

TEST_CASE("a timer that is armed anew for each call does not wake the loop more often for it") {
    fixture one;
    bool fired = false;
    ise::timer deadline(one.loop, [&fired] { fired = true; });
    int alarms = 0;
    for (int call = 0; call < 1000; ++call) {
        one.clock.at = at(call);
        deadline.arm(at(call + 10'000));
        if (one.alarm_at == at(10'000)) ++alarms;
        deadline.disarm();
    }
    CHECK(alarms == 1000); // still the first one
    one.run_until(at(100'000));
    CHECK_FALSE(fired);
    CHECK_FALSE(one.alarm_at);
}

} // namespace timers_test
