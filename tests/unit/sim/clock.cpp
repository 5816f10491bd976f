#include "talk.hpp"

#include <support/catch.hpp>

#include <set>

namespace clock_test {

using namespace talk;

namespace {

task<> tick(ise::loop& on, ise::duration period, int times, std::vector<std::string>& log, std::string name) {
    for (int i = 0; i < times; ++i) {
        co_await sleep(on, period);
        log.push_back(name);
    }
}

task<> note_after(ise::loop& on, ise::duration time, bool& over) {
    co_await sleep(on, time);
    over = true;
}

void spin(ise::loop& on) {
    asio::post(on.get_executor(), [&on] { spin(on); });
}

} // namespace

TEST_CASE("sim: ten hours pass as soon as nothing is left to do in them") {
    ise::sim::world world;
    auto& it = world.host("boat").start_process("boat");
    auto main = it.make_loop("main");
    std::vector<std::string> log;
    spawn(main->loop(), tick(main->loop(), 10min, 60, log, "tick"));
    CHECK(world.run_until_idle());
    CHECK(log.size() == 60);
    CHECK(world.elapsed() == 10h);
}

TEST_CASE("sim: what has the same time runs in the order in which it was asked for") {
    ise::sim::world world;
    auto& it = world.host("boat").start_process("boat");
    auto one = it.make_loop("one"), two = it.make_loop("two");
    std::vector<std::string> log;
    spawn(two->loop(), tick(two->loop(), 1s, 2, log, "two"));
    spawn(one->loop(), tick(one->loop(), 1s, 2, log, "one"));
    world.at(1s, [&] { log.push_back("script"); });
    world.run_for(10s);
    CHECK(log == std::vector<std::string>{"script", "two", "one", "two", "one"});
    CHECK(world.elapsed() == 10s);
}

TEST_CASE("sim: running stops when its time is over") {
    ise::sim::world world;
    auto& it = world.host("boat").start_process("boat");
    auto main = it.make_loop("main");
    bool over = false;
    spawn(main->loop(), note_after(main->loop(), 1h, over));
    CHECK_FALSE(world.run_until([&] { return over; }, 59min));
    CHECK(world.elapsed() == 59min);
    CHECK(world.run_until([&] { return over; }, 1min));
}

TEST_CASE("sim: a livelock is an error that names what is busy") {
    ise::sim::world world;
    auto& it = world.host("boat").start_process("pilot");
    auto main = it.make_loop("helm");
    world.bounds().events_at_one_time = 1000;
    spin(main->loop());
    try {
        world.run_for(1s);
        FAIL("it came to rest");
    } catch (const ise::sim::stuck& why) {
        CHECK(std::string(why.what()).find("boat/pilot/helm") != std::string::npos);
    }
}

TEST_CASE("sim: a loop on an executor of the world is adopted, another is refused") {
    ise::sim::world world;
    asio::io_context other;
    auto& it = world.host("boat").start_process("boat");
    auto adopted = it.adopt(world.context().get_executor(), true);
    auto on_top = it.adopt(adopted->loop().get_executor(), false);
    CHECK_THROWS_AS(it.adopt(other.get_executor(), true), std::logic_error);
    bool over = false, later = false;
    spawn(adopted->loop(), note_after(adopted->loop(), 1s, over));
    spawn(on_top->loop(), note_after(on_top->loop(), 2s, later));
    CHECK_FALSE(adopted->loop().running_here());
    bool inside = false;
    asio::post(world.context(), [&] { inside = adopted->loop().running_here(); });
    CHECK(world.run_until([&] { return over && later; }));
    CHECK(inside);
}

TEST_CASE("sim: what is put on the world's io_context runs, also after that had nothing to do") {
    ise::sim::world world;
    int ran = 0;
    for (int n = 1; n <= 2; ++n) {
        world.run_for(1s);
        asio::post(world.context(), [&] { ++ran; });
        CHECK(world.run_until([&] { return ran == n; }, 1s));
    }
}

TEST_CASE("sim: destroying a loop unwinds what waits on it, the others go on") {
    ise::sim::world world;
    auto& it = world.host("boat").start_process("boat");
    auto one = it.make_loop("one"), two = it.make_loop("two");
    bool first = false, second = false;
    spawn(one->loop(), note_after(one->loop(), 1s, first));
    spawn(two->loop(), note_after(two->loop(), 1s, second));
    world.run_for(500ms);
    one.reset();
    world.run_for(1min);
    CHECK_FALSE(first);
    CHECK(second);
}

TEST_CASE("sim: a frozen process catches up when it goes on") {
    ise::sim::world world;
    auto& it = world.host("boat").start_process("boat");
    auto main = it.make_loop("main");
    std::vector<std::string> log;
    spawn(main->loop(), tick(main->loop(), 1s, 100, log, "tick"));
    world.run_for(10500ms);
    CHECK(log.size() == 10);
    it.pause();
    world.run_for(10s);
    CHECK(log.size() == 10);
    it.go_on();
    world.run_for(1s);
    CHECK(log.size() == 12); // the one that was due, and one a second later
}

TEST_CASE("sim: processes with similar names draw different numbers") {
    ise::sim::world world;
    std::set<std::uint64_t> first;
    for (int i = 0; i < 10; ++i) {
        auto name = "boat" + std::to_string(i);
        first.insert(world.host(name).start_process(name).random());
    }
    CHECK(first.size() == 10);
}

} // namespace clock_test
