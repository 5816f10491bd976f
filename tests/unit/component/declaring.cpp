#include "sea.hpp"

#include <ise/component/introspection.hpp>

namespace declaring_test {

using namespace sea;
using ise::component;

namespace {

std::set<std::string> names_of(const ise::component_info& text, bool provided) {
    std::set<std::string> names;
    for (const auto& service : text.services)
        if (service.provided == provided) names.insert(service.name);
    return names;
}

} // namespace

TEST_CASE("what a component provides and requires is seen by whoever asks it") {
    fleet all;
    all.start("boat", "atirma/boat", [](component& self) -> task<> {
        self.provide(echo, [](question asked) { return reply{asked.text}; });
        auto out = self.publish(readings);
        self.require(ask_back);
        co_await self.sleep(10s);
        self.withdraw(echo);
        self.withdraw(readings);
    });
    all.run("shore", [](component& self) -> task<> {
        auto boat = self.at(fleet::at("boat"));
        ise::describe_request request;
        auto text = co_await boat.call(ise::describe_service, request);
        CHECK(text.path == "atirma/boat");
        CHECK(text.state == "ready");
        CHECK(text.host_name == "boat");
        CHECK(text.incarnation != 0);
        CHECK(text.endpoints.size() == 1);
        CHECK(text.sessions.size() == 1);
        CHECK(names_of(text, true) == std::set<std::string>{"echo", "ise.describe", "ise.health", "readings"});
        CHECK(names_of(text, false) == std::set<std::string>{"ask_back"});
        for (const auto& service : text.services)
            for (const auto& packet : service.packets) CHECK(!packet.schema.empty());
        co_await self.sleep(20s);
        auto later = co_await boat.call(ise::describe_service, request);
        CHECK(names_of(later, true) == std::set<std::string>{"ise.describe", "ise.health"});
        question asked{"still there?"};
        auto answer = co_await boat.try_call(echo, asked, 1s);
        REQUIRE(!answer);
        CHECK(answer.error().code() == ise::errc::no_such_service);
    });
}

TEST_CASE("a service that is provided already is refused with its name") {
    fleet all;
    std::string said;
    all.run("boat", [&](component& self) -> task<> {
        self.provide(echo, [](question asked) { return reply{asked.text}; });
        try {
            self.provide(echo, [](question asked) { return reply{asked.text}; });
        } catch (const ise::error& thrown) {
            said = thrown.what();
        }
        co_return;
    });
    CHECK(said.find("echo") != std::string::npos);
}

TEST_CASE("a periodic publication keeps its step on the virtual clock, and makes up for no time that it missed") {
    fleet all;
    std::vector<double> at_s;
    auto began = all.world.now();
    all.start("boat", "boat", [&](component& self) -> task<> {
        self.publish_every(readings, 1s, [&] {
            at_s.push_back(std::chrono::duration<double>(self.now() - began).count());
            return reading{at_s.size()};
        });
        co_return;
    });
    all.world.run_for(3500ms);
    CHECK(at_s == std::vector<double>{0, 1, 2, 3});
    all.process("boat").pause();
    all.world.run_for(10s);
    all.process("boat").go_on();
    all.world.run_for(1600ms); // 15.1 s
    CHECK(at_s == std::vector<double>{0, 1, 2, 3, 13.5, 14, 15});
}

TEST_CASE("a period of nothing is refused") {
    fleet all;
    CHECK(code_of([&] {
              all.run("boat", [](component& self) -> task<> {
                  self.publish_every(readings, 0s, [] { return reading{}; });
                  co_return;
              });
          }) == ise::errc::invalid_argument);
}

TEST_CASE("a listener gets every packet in order, from a provider that came long after it") {
    fleet all;
    std::vector<std::uint64_t> heard;
    all.node("boat");
    all.start("shore", "shore", [&](component& self) -> task<> {
        self.listen(self.at(fleet::at("boat")), readings,
                    [&](const reading& packet) { heard.push_back(packet.number); });
        co_return;
    });
    all.world.run_for(60s);
    CHECK(heard.empty());
    CHECK(all.log.has("waits for a provider", "readings"));
    all.node("boat").start<beacon>("boat", all.listening("boat"));
    REQUIRE(all.world.run_until([&] { return heard.size() >= 10; }, 1min));
    for (std::size_t n = 1; n < heard.size(); ++n) CHECK(heard[n] == heard[n - 1] + 1);
    CHECK(all.state("shore", "shore") == ise::component_state::ready);
}

TEST_CASE("a provider decides over its subscribers and hears of those that leave") {
    fleet all;
    std::vector<std::string> happened;
    all.start("boat", "boat", [&](component& self) -> task<> {
        ise::publication_callbacks<ise::subscription<reading>> callbacks;
        callbacks.on_subscribe = [&](const ise::nothing&,
                                     const ise::subscriber_info& who) -> ise::result<ise::nothing> {
            happened.push_back("asked " + std::to_string(who.number));
            if (who.number == 1) return ise::failure(ise::errc::refused, "not today");
            return ise::nothing{};
        };
        callbacks.on_unsubscribe = [&](const ise::nothing&, const ise::subscriber_info& who) {
            happened.push_back("left " + std::to_string(who.number));
            return ise::nothing{};
        };
        auto out = self.publish(readings, callbacks);
        for (std::uint64_t n = 1;; ++n) {
            out(reading{n});
            co_await self.sleep(1s);
        }
    });
    all.run("shore", [&](component& self) -> task<> {
        auto boat = self.at(fleet::at("boat"));
        std::string refusal;
        try {
            auto refused = co_await boat.subscribe(readings);
        } catch (const ise::error& thrown) {
            if (thrown.code() == ise::errc::refused) refusal = thrown.what();
        }
        CHECK(refusal.find("not today") != std::string::npos);
        auto packets = co_await boat.subscribe(readings);
        auto first = co_await packets.next();
        CHECK(first);
        packets.unsubscribe();
        co_await self.sleep(1s);
    });
    CHECK(happened == std::vector<std::string>{"asked 1", "asked 2", "left 2"});
}

} // namespace declaring_test
