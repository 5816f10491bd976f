// What a component uses of others, and what it waits for.
#include "sea.hpp"

#include <ise/asio.hpp>
#include <ise/component/introspection.hpp>
#include <ise/core/limits.hpp>
#include <ise/service/service_host.hpp>

#include <asio/experimental/awaitable_operators.hpp>
#include <asio/use_awaitable.hpp>

#include <algorithm>

namespace uses_test {

using namespace sea;
using ise::component;

namespace {

struct used {
    std::string name;
    bool declared;
    bool operator==(const used&) const = default;
};
std::vector<used> used_by(const ise::component_info& text) {
    std::vector<used> all;
    for (const auto& one : text.services)
        if (!one.provided) all.push_back({one.name, one.declared});
    return all;
}

/// As somebody sees it who asks `path` on `host`.
ise::component_info asked(fleet& all, const std::string& host) {
    ise::component_info text;
    all.run("observer", [&](component& self) -> task<> {
        ise::describe_request request;
        text = co_await self.at(fleet::at(host)).call(ise::describe_service, request);
    });
    return text;
}

const ise::session_info* session_with(const ise::component_info& text, const std::string& path) {
    for (const auto& one : text.sessions)
        if (one.peer.starts_with(path + " ")) return &one;
    return nullptr;
}

} // namespace

TEST_CASE("calls and subscriptions declare themselves, and each session tells what goes over it") {
    fleet all;
    all.node("boat").start<beacon>("boat", all.listening("boat"));
    all.start("shore", "shore", [](component& self) -> task<> {
        self.require(ask_back);
        auto boat = self.at(fleet::at("boat"), "boat");
        question asks{"there?"};
        co_await boat.call(echo, asks, 2s);
        ise::describe_request request;
        co_await boat.call(ise::describe_service, request, 2s); // ISE's own is nobody's use
        auto packets = co_await boat.subscribe(readings);
        for (;;) co_await packets.next();
    });
    all.world.run_for(5s);
    auto text = asked(all, "shore");
    CHECK(used_by(text) == std::vector<used>{{"ask_back", true}, {"echo", false}, {"readings", false}});
    CHECK(text.waits.empty());
    const auto* session = session_with(text, "boat");
    REQUIRE(session);
    CHECK(session->uses == std::vector<std::string>{"echo", "ise.describe", "readings"});
    auto other_end = asked(all, "boat");
    CHECK(used_by(other_end).empty());
    session = session_with(other_end, "shore");
    REQUIRE(session);
    CHECK(session->uses.empty());
}

TEST_CASE("a subscription waits for its provider, says so once, and goes on") {
    fleet all;
    all.node("boat");
    auto began = all.world.now();
    all.start("shore", "shore", [](component& self) -> task<> {
        self.listen(self.at(fleet::at("boat")), readings, [](const reading&) {});
        co_return;
    });
    all.world.run_for(20s);
    CHECK(all.log.has("waits for a provider", "'readings' of " + fleet::at("boat").text()));
    CHECK(all.log.count("waits for a provider") == 1);
    CHECK(all.log.has("waits for a provider", "since=20"));
    auto text = asked(all, "shore");
    REQUIRE(text.waits.size() == 1);
    const auto& wait = text.waits.front();
    CHECK(wait.target == fleet::at("boat").text());
    CHECK(wait.service == "readings");
    CHECK(wait.stage == "provider");
    CHECK(wait.waited >= 20s);
    CHECK(wait.waited <= all.world.now() - began);
    CHECK(!wait.cause.empty());
    all.node("boat").start<beacon>("boat", all.listening("boat"));
    REQUIRE(all.world.run_until([&] { return all.log.has("waits no longer", "readings"); }, 1min));
    CHECK(asked(all, "shore").waits.empty());
    all.process("boat").pause(); // it is lost, and waited for again from then on
    all.world.run_for(30s);
    text = asked(all, "shore");
    REQUIRE(text.waits.size() == 1);
    CHECK(text.waits.front().waited < 30s);
}

TEST_CASE("a call that reached nobody is told for a minute, and while it is tried again, since the first one") {
    fleet all;
    all.node("boat");
    bool again = true;
    all.start("shore", "shore", [&](component& self) -> task<> {
        auto boat = self.at(fleet::at("boat"));
        while (again) {
            question asks{"there?"};
            auto answer = co_await boat.try_call(echo, asks, 1s);
            CHECK(!answer);
            co_await self.sleep(1s);
        }
    });
    all.world.run_for(9500ms); // between two calls
    auto text = asked(all, "shore");
    REQUIRE(text.waits.size() == 1);
    CHECK(text.waits.front().service == "echo");
    CHECK(text.waits.front().stage == "unreached");
    CHECK(text.waits.front().waited > 9s);
    again = false;
    all.world.run_for(50s);
    CHECK(asked(all, "shore").waits.size() == 1);
    all.world.run_for(20s);
    CHECK(asked(all, "shore").waits.empty());
    CHECK(used_by(asked(all, "shore")) == std::vector<used>{{"echo", false}});
}

TEST_CASE("what was given up is not waited for any more") {
    fleet all;
    all.node("boat");
    all.start("shore", "shore", [&](component& self) -> task<> {
        using namespace asio::experimental::awaitable_operators;
        auto boat = self.at(fleet::at("boat"));
        question asks{"there?"};
        task<ise::result<reply>> call = boat.try_call(echo, asks, 1h);
        auto patient = ise::async_run(self.get_executor(), std::move(call), asio::use_awaitable);
        auto hasty = ise::async_run(self.get_executor(), self.sleep(5s), asio::use_awaitable);
        co_await (std::move(patient) || std::move(hasty));
        co_await self.sleep(1h);
    });
    all.world.run_for(4500ms);
    CHECK(asked(all, "shore").waits.size() == 1);
    all.world.run_for(3s);
    CHECK(asked(all, "shore").waits.empty());
}

TEST_CASE("of the services that a component uses at very many targets the last ones are told") {
    fleet all;
    all.node("boat").start<beacon>("boat", all.listening("boat"));
    all.run("shore", [](component& self) -> task<> {
        for (std::size_t n = 0; n <= ise::limit::used_services; ++n) {
            auto nobody =
                self.at(ise::endpoint{ise::protocol::tcp, "nobody", static_cast<std::uint16_t>(1000 + n), {}});
            question asks{"there?"};
            auto missed = co_await nobody.try_call(echo, asks, 1ms);
            CHECK(!missed);
        }
        auto waits = self.services().uses().awaited();
        CHECK(waits.size() == ise::limit::used_services);
        CHECK(std::ranges::none_of(waits, [](const auto& one) { return one.target == "tcp://nobody:1000"; }));
    });
}

} // namespace uses_test
