#include "sea.hpp"

#include <ise/asio.hpp>

#include <fmt/format.h>

namespace context_test {

using namespace sea;
using ise::component;

TEST_CASE("a handler calls its caller back over the same session") {
    fleet all;
    all.start("boat", "boat", [](component& self) -> task<> {
        self.provide(ask_back, [&self](question asked, const ise::call_context& context) -> task<reply> {
            auto caller = self.caller(context);
            auto answer = co_await caller.call(echo, asked, 2s);
            co_return reply{"you said " + answer.text};
        });
        co_return;
    });
    all.run("shore", [](component& self) -> task<> { // listens nowhere
        self.provide(echo, [](question asked) { return reply{asked.text}; });
        auto boat = self.at(fleet::at("boat"));
        question asked{"ahoy"};
        auto answer = co_await boat.call(ask_back, asked, 5s);
        CHECK(answer.text == "you said ahoy");
    });
}

TEST_CASE("a handler knows its service, its caller and its deadline, coroutine or not") {
    auto plain = GENERATE(true, false);
    fleet all;
    all.start("boat", "boat", [&](component& self) -> task<> {
        auto result = [&self](const ise::call_context& context) {
            bool in_time = context.deadline - self.now() <= 5s && context.deadline > self.now();
            return fmt::format("{} for {}{}", context.service, context.caller, in_time ? "" : ", without a deadline");
        };
        if (plain) {
            self.provide(echo, [result](question, const ise::call_context& context) { return reply{result(context)}; });
        } else {
            self.provide(echo, [result](question, const ise::call_context& context) -> task<reply> {
                co_return reply{result(context)};
            });
        }
        co_return;
    });
    all.run("shore", [](component& self) -> task<> {
        auto boat = self.at(fleet::at("boat"));
        question asked{"ahoy"};
        auto answer = co_await boat.call(echo, asked, 5s);
        CHECK_THAT(answer.text, ise_test::StartsWith("echo for ") && !ise_test::Contains("without"));
    });
}

TEST_CASE("a nested call has the smaller deadline and the same trace, and its handler is cancelled with it") {
    fleet all;
    ise::time_point inner{}, outer{};
    ise::trace_id inner_trace, outer_trace;
    census handlers;
    bool cancelled = false;
    all.start("sensor", "sensor", [&](component& self) -> task<> {
        self.provide(echo, [&](question, const ise::call_context& context) -> task<reply> {
            census::citizen alive(handlers);
            inner = context.deadline;
            inner_trace = context.trace;
            try {
                co_await self.sleep(1h);
            } catch (const std::exception&) {
                cancelled = true;
                throw;
            }
            co_return reply{};
        });
        co_return;
    });
    all.start("boat", "boat", [&](component& self) -> task<> {
        self.provide(ask_back, [&](question asked, const ise::call_context& context) -> task<reply> {
            outer = context.deadline;
            outer_trace = context.trace;
            auto sensor = self.at(fleet::at("sensor"));
            auto answer = co_await sensor.call(echo, asked, 1min);
            co_return answer;
        });
        co_return;
    });
    all.run("shore", [&](component& self) -> task<> {
        auto boat = self.at(fleet::at("boat"));
        auto began = self.now();
        ise::call_context root;
        root.trace.trace = 7;
        auto call = [](ise::remote provider) -> task<ise::result<reply>> {
            question asked{"?"};
            auto answer = co_await provider.try_call(ask_back, asked, 3s);
            co_return answer;
        };
        auto calling = call(boat);
        auto answer =
            co_await ise::async_run(ise::with_context(self.get_executor(), &root), std::move(calling), ise::use_task);
        REQUIRE(!answer);
        CHECK(answer.error().code() == ise::errc::timed_out);
        CHECK(self.now() - began == 3s);
        co_await self.sleep(1s);
    });
    CHECK(cancelled);
    CHECK(handlers.alive == 0);
    CHECK(inner <= outer + 1s); // the network takes some of it
    CHECK(outer > ise::time_point{});
    CHECK(outer_trace.trace == 7);
    CHECK(inner_trace.trace == 7);
}

TEST_CASE("offloaded work gives its value, and throws where it is awaited") {
    fleet all;
    all.run("boat", [](component& self) -> task<> {
        std::string text = "of the coroutine";
        auto work = [&text] { return "made " + text; };
        auto made = co_await self.offload(work);
        CHECK(made == "made of the coroutine");
        bool thrown = false;
        auto failing = []() -> int { throw std::runtime_error("no number"); };
        try {
            [[maybe_unused]] auto number = co_await self.offload(failing);
        } catch (const std::runtime_error& problem) {
            thrown = problem.what() == std::string("no number");
        }
        CHECK(thrown);
        int calls = 0;
        auto nothing = [&calls] { ++calls; };
        co_await self.offload(nothing);
        CHECK(calls == 1);
    });
}

TEST_CASE("nothing blocks in the virtual world") {
    fleet all;
    auto& boat = all.start("boat", "boat", [](component& self) -> task<> { co_await self.sleep(1h); });
    auto idle = [](component& self) -> task<> { co_await self.sleep(1s); };
    CHECK(code_of([&] { boat.wait(idle(boat)); }) == ise::errc::would_block_self);
    CHECK(code_of([&] { all.node("boat").wait(); }) == ise::errc::would_block_self);
}

TEST_CASE("a component that was not started says so") {
    struct early : component {
        early() { spawn("too early", task<>{}); }
        task<> run() override { co_return; }
    };
    CHECK(code_of([] { early never; }) == ise::errc::invalid_argument);
}

} // namespace context_test
