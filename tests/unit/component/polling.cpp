// Nodes that poll do what the others do.
#include "sea.hpp"

#include <ise/asio.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/service/service_host.hpp>

#include <asio/io_context.hpp>

#include <support/local_sockets.hpp>

#include <csignal>
#include <thread>

namespace polling_test {

using namespace sea;
using ise::component;

namespace {

ise::node_options polling(ise::duration window) {
    ise::node_options made;
    made.use_names = false;
    made.poll = window;
    return made;
}

task<> idle(component& self) { co_await self.sleep(1h); }

ise::component_options listening_on(const std::string& where) {
    ise::component_options options;
    options.listen = {ise::endpoint::parse(where).value()};
    return options;
}

task<int> ask_often(component& self, ise::endpoint where, int times) {
    auto provider = self.at(where);
    int right = 0;
    for (int n = 0; n < times; ++n) {
        question asked{std::to_string(n)};
        auto answer = co_await provider.call(echo, asked, 60s);
        right += answer.text == std::to_string(n);
    }
    co_return right;
}

void stop(ise::node& node) {
    node.stop();
    node.wait();
    for (const auto& report : node.reports()) CHECK(report.still_running.empty());
}

// The components of a node whose environment says for how long to poll.
ise::errc made_with(const std::string& message) {
    fleet at;
    at.process("shore").set_variable("ISE_POLL_US", message);
    return code_of([&] { at.node("shore"); });
}

} // namespace

TEST_CASE("polling: components call each other, over each transport and in one process") {
    // A window that is never over, and one that always is.
    auto window = GENERATE(as<ise::duration>{}, 1s, 1us);
    auto where = GENERATE(from_range(ise_test::usable_here(
        {"tcp://127.0.0.1:0", "udp://127.0.0.1:0", "local://@ise-unit-polling", "inproc://polling"})));
    ise::real_environment env;
    ise::node node(env, polling(window));
    auto& provider = node.start<beacon>("beacon", listening_on(where));
    auto at = provider.services().listening().front();
    auto& one = node.start("one", idle);
    auto& two = node.start("two", idle);
    std::thread other([&] { CHECK(two.wait(ask_often(two, at, 200)) == 200); });
    CHECK(one.wait(ask_often(one, at, 200)) == 200);
    other.join();
    stop(node);
}

TEST_CASE("polling: timers fire, and what other threads post is done") {
    ise::real_environment env;
    ise::node node(env, polling(1s));
    auto& sleeper = node.start("sleeper", idle);
    auto naps = [](component& self) -> task<int> {
        int count = 0;
        for (; count < 50; ++count) co_await self.sleep(200us);
        co_return count;
    };
    CHECK(sleeper.wait(naps(sleeper)) == 50);
    auto tell = [](component&, int n) -> task<int> { co_return n; };
    for (int n = 0; n < 100; ++n) CHECK(sleeper.wait(tell(sleeper, n)) == n);
    stop(node);
}

TEST_CASE("polling: a node stops while its components poll, and when they have just begun") {
    for (int n = 0; n < 20; ++n) {
        ise::real_environment env;
        ise::node node(env, polling(1s));
        auto& provider = node.start<beacon>("beacon", listening_on("tcp://127.0.0.1:0"));
        auto& asker = node.start("asker", idle);
        if (n % 2 == 0) CHECK(asker.wait(ask_often(asker, provider.services().listening().front(), n)) == n);
        stop(node);
    }
}

TEST_CASE("polling: a signal ends the program") {
    ise::real_environment env;
    ise::node node(env, polling(1s));
    auto& provider = node.start<beacon>("beacon", listening_on("tcp://127.0.0.1:0"));
    auto& asker = node.start("asker", idle);
    CHECK(asker.wait(ask_often(asker, provider.services().listening().front(), 100)) == 100);
    CHECK(ise::run_until_signal(node, [] { ::raise(SIGINT); }) == 0);
    CHECK(node.all_stopped());
}

TEST_CASE("polling: an executor of the program is run as the program likes") {
    ise::real_environment env;
    asio::io_context program;
    ise::node node(env, polling(1s));
    auto options = listening_on("tcp://127.0.0.1:0");
    options.executor = program.get_executor();
    options.one_thread = true;
    auto& provider = node.start<beacon>("beacon", options);
    auto at = provider.services().listening().front();
    std::thread runs([&] { program.run(); });
    auto& asker = node.start("asker", idle);
    CHECK(asker.wait(ask_often(asker, at, 50)) == 50);
    stop(node);
    runs.join(); // nothing is left queued
}

TEST_CASE("polling: the virtual world does not sleep, and goes the same way with it and without") {
    auto sail = [](std::optional<ise::duration> window) {
        ise::sim::world world(7);
        log_book log;
        auto options = polling(window.value_or(ise::duration{}));
        options.poll = window;
        options.log = log.sink();
        ise::node shore(world.host("shore").start_process("program"), options),
            boat(world.host("boat").start_process("program"), options);
        ise::component_options listens;
        listens.listen = {fleet::at("boat")};
        boat.start<beacon>("beacon", listens);
        ise::component_options quiet;
        quiet.listens = false;
        int right = 0;
        auto main = [&right](component& self) -> task<> { right = co_await ask_often(self, fleet::at("boat"), 20); };
        shore.start("asker", main, quiet);
        world.run_for(10s);
        CHECK(right == 20);
        return std::pair(world.trace().hash(), world.now());
    };
    CHECK(sail(std::nullopt) == sail(1s));
}

TEST_CASE("polling: what is no time to poll for is refused") {
    CHECK(made_with("") == ise::errc{});
    CHECK(made_with("0") == ise::errc{});
    CHECK(made_with("1000000") == ise::errc{});
    for (auto* wrong : {"1000001", "-1", "50us", "1e3", " 5", "99999999999999999999"})
        CHECK(made_with(wrong) == ise::errc::invalid_argument);
    ise::real_environment env;
    CHECK(code_of([&] { ise::node node(env, polling(-1ns)); }) == ise::errc::invalid_argument);
    CHECK(code_of([&] { ise::node node(env, polling(2s)); }) == ise::errc::invalid_argument);
}

} // namespace polling_test
