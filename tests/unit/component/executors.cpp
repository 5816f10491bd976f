// Components on threads, on executors of the program, and together: real time, real sockets.
#include "sea.hpp"

#include <ise/asio.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/service/service_host.hpp>

#include <asio/awaitable.hpp>
#include <asio/co_spawn.hpp>
#include <asio/detached.hpp>
#include <asio/io_context.hpp>
#include <asio/use_awaitable.hpp>
#include <fmt/format.h>

#include <support/local_sockets.hpp>

#include <atomic>
#include <future>
#include <memory>
#include <thread>

#include <unistd.h>

namespace executors_test {

using namespace sea;
using ise::component;

namespace {

struct harbour {
    log_book log;
    ise::real_environment env;
    ise::node node{env, options(log)};

    static ise::node_options options(const log_book& log) {
        ise::node_options made;
        made.use_names = false;
        made.log = log.sink();
        return made;
    }
    ise::endpoint at(const ise::component& whose) { return whose.services().listening().front(); }
    void stop() {
        node.stop();
        node.wait();
        for (const auto& report : node.reports()) CHECK(report.still_running.empty());
    }
};

task<> idle(component& self) { co_await self.sleep(1h); }

task<std::string> ask(component& self, ise::endpoint where) {
    auto provider = self.at(where);
    question asked{"ahoy"};
    auto answer = co_await provider.call(echo, asked, 30s);
    co_return answer.text;
}

ise::component_options listening_on(const std::string& where) {
    ise::component_options options;
    options.listen = {ise::endpoint::parse(where).value()};
    return options;
}

} // namespace

TEST_CASE("components run on threads of their own, or together on one") {
    harbour here;
    std::promise<std::thread::id> a, b, c;
    auto tell = [](std::promise<std::thread::id>& where) {
        return [&where](component& self) -> task<> {
            where.set_value(std::this_thread::get_id());
            co_await self.sleep(1h);
        };
    };
    here.node.start("a", tell(a));
    here.node.start("b", tell(b));
    ise::component_options with_a;
    with_a.together_with = "a";
    here.node.start("c", tell(c), with_a);
    auto on_a = a.get_future().get();
    CHECK(on_a != b.get_future().get());
    CHECK(on_a == c.get_future().get());
    here.node.stop("a"); // c goes on
    auto& asker = here.node.start("asker", idle);
    auto& beside = here.node.start<beacon>("beacon");
    CHECK(asker.wait(ask(asker, here.at(beside))) == "ahoy");
    here.stop();
}

TEST_CASE("nothing can share the loop of a component that is not there") {
    harbour here;
    ise::component_options with;
    with.together_with = "nobody";
    CHECK(code_of([&] { here.node.start("a", idle, with); }) == ise::errc::invalid_argument);
    here.node.start("gone", idle);
    here.stop();
    with.together_with = "gone";
    CHECK(code_of([&] { here.node.start("a", idle, with); }) == ise::errc::invalid_argument);
    CHECK(here.node.components().size() == 1);
}

TEST_CASE("a component runs on the io_context of the program") {
    asio::io_context program;
    harbour here;
    auto options = listening_on("tcp://127.0.0.1:0");
    options.executor = program.get_executor();
    SECTION("that one thread runs") {
        options.one_thread = true;
        auto& provider = here.node.start<beacon>("beacon", options);
        std::string answer;
        auto main = [](component& self, ise::endpoint where, ise::node& node, std::string& message) -> task<> {
            message = co_await ask(self, where);
            node.stop();
            co_await node.stopped();
        };
        ise::component_options quiet;
        quiet.listens = false;
        quiet.together_with = "beacon";
        auto& asker = here.node.start("asker", idle, quiet);
        bool over = false;
        ise::async_run(program.get_executor(), main(asker, here.at(provider), here.node, answer),
                       [&](std::exception_ptr) { over = true; });
        while (!over && program.run_one() > 0) {}
        CHECK(answer == "ahoy");
    }
    SECTION("that many threads run already, where it shares its loop with another") {
        auto open = asio::make_work_guard(program);
        std::vector<std::thread> threads;
        for (int n = 0; n < 4; ++n) threads.emplace_back([&] { program.run(); });
        for (int n = 0; n < 8; ++n) {
            auto name = "beacon" + std::to_string(n);
            auto& provider = here.node.start<beacon>(name, options);
            ise::component_options beside;
            beside.together_with = name;
            auto& asker = here.node.start(name + "/beside", idle, beside);
            CHECK(asker.wait(ask(asker, here.at(provider))) == "ahoy");
        }
        // A thread of the program's would wait for the loop that it has to run.
        std::promise<void> refused;
        asio::post(program, [&] {
            ise::component_options beside;
            beside.together_with = "beacon0";
            CHECK(code_of([&] { here.node.start("late", idle, beside); }) == ise::errc::would_block_self);
            here.node.start("alone", idle, options);
            refused.set_value();
        });
        refused.get_future().get();
        here.node.stop();
        here.node.wait();
        program.stop();
        for (auto& thread : threads) thread.join();
        program.restart();
        open.reset();
        program.poll();
        CHECK(program.stopped()); // nothing of ISE is left for it to wait for, also not of the one that was refused
    }
    SECTION("that many threads run") {
        auto& provider = here.node.start<beacon>("beacon", options);
        auto where = here.at(provider);
        auto open = asio::make_work_guard(program);
        std::vector<std::thread> threads;
        for (int n = 0; n < 3; ++n) threads.emplace_back([&] { program.run(); });
        auto& asker = here.node.start("asker", idle);
        for (int n = 0; n < 20; ++n) CHECK(asker.wait(ask(asker, where)) == "ahoy");
        CHECK(provider.wait(ask(provider, where)) == "ahoy"); // itself
        here.node.stop();
        here.node.wait();
        open.reset();
        for (auto& thread : threads) thread.join();
    }
    CHECK(here.node.all_stopped());
    for (const auto& report : here.node.reports()) CHECK(report.still_running.empty());
}

TEST_CASE("a component whose executor was never run is left to it, and named") {
    asio::io_context program;
    log_book log;
    {
        ise::real_environment env;
        auto options = harbour::options(log);
        options.grace = 1ms;
        auto node = std::make_unique<ise::node>(env, options);
        auto on_program = listening_on("tcp://127.0.0.1:0");
        on_program.executor = program.get_executor();
        node->start<beacon>("beacon", on_program);
        node.reset();
        CHECK(log.has("left behind", "beacon"));
        program.restart();
    }
}

TEST_CASE("a thread waits for what a component does") {
    harbour here;
    auto& provider = here.node.start<beacon>("beacon");
    auto& asker = here.node.start("asker", idle);
    CHECK(asker.wait(ask(asker, here.at(provider))) == "ahoy");
    auto nothing = [](component& self) -> task<> { co_await self.sleep(1ms); };
    asker.wait(nothing(asker));
    auto failing = [](component& self) -> task<int> {
        co_await self.sleep(1ms);
        throw std::runtime_error("aground");
    };
    CHECK_THROWS_WITH(asker.wait(failing(asker)), "aground");

    SECTION("but not on its own thread") {
        auto self_wait = [](component& self, ise::endpoint where) -> task<ise::errc> {
            ise::errc code{};
            try {
                self.wait(ask(self, where));
            } catch (const ise::error& thrown) {
                code = thrown.code();
            }
            co_return code;
        };
        CHECK(asker.wait(self_wait(asker, here.at(provider))) == ise::errc::would_block_self);
    }
    SECTION("and is let go when the component stops meanwhile") {
        std::promise<void> waiting;
        auto forever = [](component& self, std::promise<void>& result) -> task<> {
            result.set_value();
            co_await self.sleep(1h);
        };
        auto waiter =
            std::async(std::launch::async, [&] { return code_of([&] { asker.wait(forever(asker, waiting)); }); });
        waiting.get_future().get();
        here.node.stop("asker");
        CHECK(waiter.get() == ise::errc::cancelled);
    }
    SECTION("and not for one that has stopped") {
        here.stop();
        CHECK(code_of([&] { asker.wait(nothing(asker)); }) == ise::errc::cancelled);
    }
}

TEST_CASE("a handle that is used off its component's thread says so, and nothing else happens") {
    harbour here;
    auto& provider = here.node.start<beacon>("beacon");
    auto& asker = here.node.start("asker", idle);
    auto make = [](component& self, ise::endpoint where) -> task<ise::remote> { co_return self.at(where); };
    auto handle = asker.wait(make(asker, here.at(provider)));

    asio::io_context program; // not the component's
    std::string call_said, subscribe_said;
    auto misuse = [](ise::remote there, std::string& call, std::string& subscribe) -> task<> {
        question asked{"ahoy"};
        auto answer = co_await there.try_call(echo, asked, 5s);
        if (!answer && answer.error().code() == ise::errc::invalid_argument) call = answer.error().message();
        try {
            auto packets = co_await there.subscribe(readings);
        } catch (const ise::error& thrown) {
            subscribe = thrown.what();
        }
    };
    ise::async_run(program.get_executor(), misuse(handle, call_said, subscribe_said), asio::detached);
    program.run();
    CHECK(call_said.find("off its component's thread") != std::string::npos);
    CHECK(subscribe_said.find("off its component's thread") != std::string::npos);
    auto drop = [](component&, ise::remote) -> task<> { co_return; };
    asker.wait(drop(asker, std::move(handle)));
    here.stop();
}

TEST_CASE("a start that fails says why and leaves nothing behind") {
    harbour here;
    auto& first = here.node.start<beacon>("first", listening_on("tcp://127.0.0.1:0"));
    auto taken = here.at(first);
    auto for_a_moment =
        ise::endpoint::parse(
            GENERATE(from_range(ise_test::usable_here(
                {"local://@ise-test-leaves-nothing-" + std::to_string(::getpid()), "inproc://leaves-nothing"}))))
            .value();
    ise::component_options options;
    ise::errc expected{};
    std::string part;
    SECTION("when the port is in use") {
        options.listen = {for_a_moment, taken};
        expected = ise::errc::address_in_use;
        part = taken.text();
    }
    SECTION("when the address is none of this host") {
        options.listen = {for_a_moment, ise::endpoint::parse("tcp://203.0.113.7:0").value()};
        expected = ise::errc::io_failed;
        part = "203.0.113.7";
    }
    bool together = GENERATE(false, true);
    if (together) options.together_with = "first";
    std::string said;
    ise::errc code{};
    try {
        here.node.start<beacon>("second", options);
    } catch (const ise::error& thrown) {
        code = thrown.code();
        said = thrown.what();
    }
    CAPTURE(said, together);
    CHECK(code == expected);
    CHECK(said.find(part) != std::string::npos);
    CHECK(here.node.components().size() == 1);
    options.listen.resize(1); // what it listened on for a moment is free
    auto& second = here.node.start<beacon>("second", options);
    auto& asker = here.node.start("asker", idle);
    CHECK(asker.wait(ask(asker, here.at(second))) == "ahoy");
    here.stop();
}

TEST_CASE("a path is used once in a node, and again when its component has stopped") {
    harbour here;
    here.node.start("boat", idle);
    CHECK(code_of([&] { here.node.start("boat", idle); }) == ise::errc::name_taken);
    here.node.start("", idle);
    here.node.start("", idle); // anonymous ones do not meet
    here.stop();
    auto& again = here.node.start<beacon>("boat");
    CHECK(again.wait(ask(again, here.at(again))) == "ahoy");
    here.node.stop("boat");
    here.node.wait();
    CHECK(again.state() == ise::component_state::stopped);
}

TEST_CASE("a path that is none is refused with what one looks like") {
    harbour here;
    auto path = GENERATE(std::string("/boat"), std::string("boat/"), std::string("a//b"), std::string("a b"),
                         std::string("b\xc3\xb6"
                                     "at"),
                         std::string("a\nb"), std::string(201, 'a'), std::string("a\0b", 3));
    CAPTURE(path, path.size());
    std::string said;
    try {
        here.node.start(path, idle);
    } catch (const ise::error& thrown) {
        if (thrown.code() == ise::errc::invalid_argument) said = thrown.what();
    }
    CHECK(said.find("atirma/shore/xbee") != std::string::npos);
    CHECK(here.node.components().empty());
}

TEST_CASE("a node is destroyed while calls are pending between its components: both ends of them are cancelled first") {
    struct at_end {
        explicit at_end(std::atomic<bool>& of) : flag(of) {}
        ~at_end() { flag = true; }
        std::atomic<bool>& flag;
    };
    std::atomic<bool> handler_ended = false, caller_ended = false;
    std::promise<void> provided, serving;
    auto here = std::make_unique<harbour>();
    auto& provider = here->node.start("provider", [&](component& self) -> task<> {
        self.provide(echo, [&](question) -> task<reply> {
            at_end mark(handler_ended);
            serving.set_value();
            co_await self.sleep(1h);
            co_return reply{};
        });
        provided.set_value();
        co_await self.sleep(1h);
    });
    auto where = here->at(provider);
    provided.get_future().get(); // sooner, there is no such service
    here->node.start("asker", [where, &caller_ended](component& self) -> task<> {
        at_end mark(caller_ended);
        auto answer = co_await ask(self, where);
    });
    serving.get_future().get();
    CHECK_FALSE((handler_ended || caller_ended));
    here.reset();
    CHECK((handler_ended && caller_ended));
}

TEST_CASE("components start and stop from many threads at once") {
    harbour here;
    std::atomic<int> started = 0;
    std::mutex mutex;
    std::vector<std::string> unexpected; // another error than that the name is taken, or that it was stopped meanwhile
    std::vector<std::thread> threads;
    for (int who = 0; who < 3; ++who)
        threads.emplace_back([&, who] {
            for (int n = 0; n < 10; ++n) {
                auto path = fmt::format("c{}", (who + n) % 3); // they meet
                try {
                    here.node.start<beacon>(path);
                    ++started;
                } catch (const ise::error& thrown) {
                    std::lock_guard held(mutex);
                    if (thrown.code() != ise::errc::name_taken && thrown.code() != ise::errc::cancelled)
                        unexpected.push_back(thrown.what());
                }
                here.node.stop(path);
            }
        });
    for (auto& thread : threads) thread.join();
    CHECK(unexpected == std::vector<std::string>{});
    CHECK(started > 0);
    here.stop();
    for (const auto& one : here.node.components()) CHECK(one.state == ise::component_state::stopped);
}

TEST_CASE("a plain coroutine of the program awaits a task that runs on a component's loop") {
    harbour here;
    auto& provider = here.node.start<beacon>("beacon");
    auto& asker = here.node.start("asker", idle);
    auto where = here.at(provider);
    auto ask_there = [](component& self, ise::endpoint at) -> task<std::string> {
        auto answer = co_await self.at(at).call(echo, "ahoy", 5s);
        co_return answer.text;
    };
    asio::io_context program;
    std::string heard;
    auto plain = [&](component& self, ise::endpoint at) -> asio::awaitable<void> {
        auto asking = ise::async_run(self.get_executor(), ask_there(self, at), asio::use_awaitable);
        heard = co_await std::move(asking);
    };
    asio::co_spawn(program, plain(asker, where), asio::detached);
    program.run();
    CHECK(heard == "ahoy");
    here.stop();
}

} // namespace executors_test
