#include "system.hpp"

#include <ise/component/introspection.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>

namespace stories_test {

using namespace names_test;

TEST_CASE(
    "names: a component on another host is found, called and listened to, whatever protocol it was started with") {
    auto listens = GENERATE(std::string("tcp://0.0.0.0:0"), std::string("udp://0.0.0.0:0"));
    CAPTURE(listens);
    names_test::system it;
    it.start_doubler("boat", "atirma/doubler", listens);
    std::int64_t answer = 0, heard = 0;
    it.start_body("shore", "console", [&](ise::component& self) -> ise::task<> {
        auto doubler = co_await self.find("atirma/doubler");
        auto got = co_await doubler.call(twice, number{21}, 2s);
        answer = got.value;
        auto counts = co_await doubler.subscribe(count);
        auto packet = co_await counts.next();
        heard = packet->value;
    });
    CHECK(it.world.run_until([&] { return heard != 0; }, 10s));
    CHECK(answer == 42);
    CHECK(it.epoch_of("atirma/doubler") != 0);
    CHECK(it.holds("test/console"));
}

TEST_CASE("names: find waits for a component that starts later") {
    names_test::system it;
    bool found = false, failed = false;
    it.start_body("shore", "patient", [&](ise::component& self) -> ise::task<> {
        co_await self.find("atirma/doubler", 60s);
        found = true;
    });
    it.start_body("shore", "hasty", [&](ise::component& self) -> ise::task<> {
        try {
            co_await self.find("atirma/doubler", 5s);
        } catch (const ise::error& thrown) {
            failed = thrown.code() == ise::errc::no_such_name &&
                     std::string(thrown.what()).find("atirma/doubler") != std::string::npos;
        }
    });
    it.world.run_for(30s);
    CHECK(failed);
    CHECK_FALSE(found);
    it.start_doubler("boat", "atirma/doubler");
    CHECK(it.world.run_until([&] { return found; }, 1s)); // it is told, and does not ask every now and then
}

TEST_CASE("names: find without a limit waits, and everybody sees for what and since when") {
    names_test::system it;
    bool found = false;
    it.start_body("shore", "patient", [&](ise::component& self) -> ise::task<> {
        co_await self.find("atirma/doubler");
        found = true;
        co_await self.sleep(1h);
    });
    auto seen = [&] {
        std::optional<ise::component_info> result;
        it.start_body("office", "observer", [&](ise::component& self) -> ise::task<> {
            auto patient = co_await self.find("test/patient", 5s);
            ise::describe_request request;
            result = co_await patient.call(ise::describe_service, request, 5s);
        });
        REQUIRE(it.world.run_until([&] { return result.has_value(); }, 30s));
        return *result;
    };
    auto listed = [&] {
        for (const auto& event : it.names->names()->snapshot("test/patient")) return event.name.waits_for;
        return std::string("nobody");
    };
    it.world.run_for(1s);
    CHECK(listed().empty());
    it.world.run_for(1h);
    CHECK_FALSE(found);
    CHECK(listed() == "atirma/doubler");
    auto result = seen();
    REQUIRE(result.waits.size() == 1);
    CHECK(result.waits.front().target == "atirma/doubler");
    CHECK(result.waits.front().service.empty());
    CHECK(result.waits.front().stage == "name");
    CHECK(result.waits.front().waited > 1h);
    it.start_doubler("boat", "atirma/doubler");
    CHECK(it.world.run_until([&] { return found; }, 1s));
    it.world.run_for(2s);
    CHECK(listed().empty());
    CHECK(seen().waits.empty());
}

TEST_CASE("names: without a name server find says so") {
    names_test::system it;
    it.server->stop();
    std::optional<ise::errc> code;
    it.start_body("shore", "console", [&](ise::component& self) -> ise::task<> {
        try {
            co_await self.find("atirma/doubler", 5s);
        } catch (const ise::error& thrown) {
            code = thrown.code();
        }
    });
    CHECK(it.world.run_until([&] { return code.has_value(); }, 10s));
    CHECK(*code == ise::errc::name_server_lost);
}

TEST_CASE("names: a path that is held by a living component stops the second one, which is told who has it") {
    names_test::system it;
    it.start_doubler("boat", "atirma/doubler");
    it.world.run_for(2s);
    auto first = it.epoch_of("atirma/doubler");
    ise::node* second = nullptr;
    auto& process = it.start("shore", "thief", [&](ise::node& node) {
        second = &node;
        node.start<doubler>("atirma/doubler", everywhere());
    });
    REQUIRE(it.world.run_until([&] { return second->all_stopped(); }, 10s));
    auto reports = second->reports();
    REQUIRE(reports.size() == 1);
    CAPTURE(reports[0].failure);
    CHECK(reports[0].failure.find("atirma/doubler") != std::string::npos);
    CHECK(reports[0].failure.find("on boat at tcp://") != std::string::npos);
    CHECK(process.running());
    it.world.run_for(10s);
    CHECK(it.epoch_of("atirma/doubler") == first);
}

TEST_CASE("names: who wants a taken name is told in time, also where the server restarts before the holder has shown "
          "that it lives") {
    names_test::system it;
    it.start_doubler("boat", "atirma/doubler");
    it.world.run_for(60s); // many renewals, of which the next server knows nothing
    ise::node* second = nullptr;
    it.start("shore", "thief", [&](ise::node& node) {
        second = &node;
        node.start<doubler>("atirma/doubler", everywhere());
    });
    it.world.run_for(300ms); // it has asked, and waits for the holder's renewals
    REQUIRE_FALSE(second->all_stopped());
    it.server->crash();
    it.restart_server();
    CHECK(it.world.run_until([&] { return second->all_stopped(); }, 10s));
    CHECK(it.holds("atirma/doubler"));
}

TEST_CASE("names: a component that stops takes its name with it, and the next gets a higher epoch at once") {
    names_test::system it;
    ise::node* boat = nullptr;
    it.start("boat", "boat", [&](ise::node& node) {
        boat = &node;
        node.start<doubler>("a/one", everywhere());
        node.start<doubler>("a/two", everywhere());
    });
    REQUIRE(it.world.run_until([&] { return it.holds("a/one") && it.holds("a/two"); }, 5s));
    auto epoch = it.epoch_of("a/one");
    boat->stop("a/one");
    REQUIRE(it.world.run_until([&] { return !it.holds("a/one"); }, 1s));
    CHECK(it.holds("a/two"));
    it.start_doubler("shore", "a/one");
    REQUIRE(it.world.run_until([&] { return it.holds("a/one"); }, 1s));
    CHECK(it.epoch_of("a/one") > epoch);
}

TEST_CASE("names: many components that leave at once are told of once each") {
    constexpr int many = 600;
    names_test::system it;
    ise::node* boat = nullptr;
    it.start("boat", "boat", [&](ise::node& node) {
        boat = &node;
        for (int i = 0; i < many; ++i) node.start<doubler>("a/" + std::to_string(i), everywhere());
    });
    auto registered = [&] { return it.holds("a/0") ? it.names->names()->snapshot("a").size() : 0; };
    REQUIRE(it.world.run_until([&] { return registered() == many; }, 30s));
    const auto before = it.world.net().delivered(ise::sim::direction::to_server);
    boat->stop();
    REQUIRE(it.world.run_until([&] { return it.names->names()->snapshot("a").empty(); }, 1s));
    CHECK(boat->all_stopped());
    CHECK(it.world.net().delivered(ise::sim::direction::to_server) - before < many * 200);
}

TEST_CASE("names: components that leave do not wait for a server that does not answer, one after the other") {
    names_test::system it;
    ise::node* boat = nullptr;
    it.start("boat", "boat", [&](ise::node& node) {
        boat = &node;
        for (int i = 0; i < 20; ++i) node.start<doubler>("a/" + std::to_string(i), everywhere());
    });
    REQUIRE(it.world.run_until([&] { return it.holds("a/0") && it.holds("a/19"); }, 5s));
    it.server->crash();
    boat->stop();
    CHECK(it.world.run_until([&] { return boat->all_stopped(); }, 10s));
}

TEST_CASE("names: a crashed process loses its names when its lease is over, and its next life gets them") {
    names_test::system it;
    auto& process = it.start_doubler("boat", "atirma/doubler");
    std::vector<std::int64_t> answers;
    it.start_body("shore", "console", [&](ise::component& self) -> ise::task<> {
        auto doubler = self.at("atirma/doubler");
        for (;;) {
            auto got = co_await doubler.try_call(twice, number{4}, 20s);
            if (got) answers.push_back(got->value);
            co_await self.sleep(100ms);
        }
    });
    REQUIRE(it.world.run_until([&] { return !answers.empty(); }, 5s));
    auto epoch = it.epoch_of("atirma/doubler");

    SECTION("started again at once, it waits for the lease of its former life") {
        process.restart();
        auto before = answers.size();
        CHECK(it.world.run_until([&] { return it.epoch_of("atirma/doubler") > epoch; }, 4s));
        CHECK(it.world.run_until([&] { return answers.size() > before + 3; }, 10s));
    }
    SECTION("gone for good, its name is free") {
        process.crash();
        CHECK(it.world.run_until([&] { return !it.holds("atirma/doubler"); }, 4s));
    }
    SECTION("its host gone without a word, its name is free too") {
        it.world.host("boat").crash();
        CHECK(it.world.run_until([&] { return !it.holds("atirma/doubler"); }, 4s));
    }
}

TEST_CASE("names: who lost a component is told when its next life is there, however long that took") {
    names_test::system it;
    auto& process = it.start_doubler("boat", "atirma/doubler");
    std::int64_t heard = 0;
    bool subscribed = false, answered = false;
    it.start_body("shore", "listener", [&](ise::component& self) -> ise::task<> {
        auto counts = co_await self.at("atirma/doubler").subscribe(count);
        subscribed = true;
        for (;;) {
            auto packet = co_await counts.next();
            heard = packet->value;
        }
    });
    auto& caller = it.start_body("shore", "caller", [&](ise::component& self) -> ise::task<> {
        auto doubler = self.at("atirma/doubler");
        for (;;) { // its deadlines are short, so that the pauses between tries grow
            auto got = co_await doubler.try_call(twice, number{4}, 1s);
            answered = got.has_value();
            co_await self.sleep(1s);
        }
    });
    REQUIRE(it.world.run_until([&] { return subscribed && answered && heard > 0; }, 10s));
    auto away = GENERATE(500ms, 3s, 45s, 200s); // within the lease, and behind it
    CAPTURE(away.count());
    process.crash();
    it.world.run_for(away);
    auto epoch = it.epoch_of("atirma/doubler");
    heard = 0;
    answered = false;
    process.restart();
    REQUIRE(it.world.run_until([&] { return it.epoch_of("atirma/doubler") > epoch; }, 5s));
    // All who lost it come back within a tenth of `max_back_off`; the first packet is published after 100 ms.
    CHECK(it.world.run_until([&] { return heard > 0; }, 800ms));
    CHECK(it.world.run_until([&] { return answered; }, 2s)); // it pauses for a second between its calls
    CHECK(caller.running());
}

TEST_CASE("names: over a slow way to the server, the next lives are found while many ask") {
    names_test::system it;
    constexpr std::size_t many = 4;
    auto& process = it.start("boat", "doublers", [](ise::node& node) {
        for (std::size_t n = 0; n < many; ++n)
            node.start<names_test::doubler>(fmt::format("a/{}", n),
                                            names_test::everywhere(fmt::format("tcp://0.0.0.0:{}", 7401 + n)));
    });
    it.world.net().between("shore", "ns").latency = 200ms;
    std::array<bool, many> answered{};
    it.start_body("shore", "caller", [&](ise::component& self) -> ise::task<> {
        auto ask = [](ise::component& from, std::string path, bool& heard) -> ise::task<> {
            auto doubler = from.at(path);
            for (;;) {
                auto got = co_await doubler.try_call(twice, number{4}, 1s);
                heard = got.has_value();
                co_await from.sleep(10ms);
            }
        };
        for (std::size_t n = 0; n < many; ++n) self.spawn("asks", ask(self, fmt::format("a/{}", n), answered[n]));
        for (;;) { // and one is in a hurry
            try {
                co_await self.find("a/0", 100ms);
            } catch (const ise::error&) {}
            co_await self.sleep(100ms);
        }
    });
    auto all = [&] { return std::ranges::all_of(answered, std::identity()); };
    REQUIRE(it.world.run_until(all, 10s));
    it.world.net().partition("shore", "ns"); // the server is missed once
    process.crash();
    it.world.run_for(5s);
    process.restart(); // at the same endpoints, where the former lives are not any more
    it.world.net().heal("shore", "ns");
    answered = {};
    CHECK(it.world.run_until(all, 30s));
}

TEST_CASE("names: a server that restarts is whole within two leases, and nobody's sessions notice") {
    auto away = GENERATE(ise::duration(0s), ise::duration(1s), ise::duration(40s));
    CAPTURE(away.count());
    names_test::system it;
    const std::vector<std::string> paths{"a/one", "a/two", "a/three", "a/four"};
    for (const auto& path : paths) it.start_doubler("host of " + path.substr(2), path);
    std::uint64_t lost = 0, heard = 0;
    std::int64_t failed_calls = 0, calls = 0;
    it.start_body("shore", "console", [&](ise::component& self) -> ise::task<> {
        auto doubler = co_await self.find("a/one");
        auto counts = co_await doubler.subscribe(count);
        for (;;) {
            auto packet = co_await counts.next();
            if (!packet) break;
            ++heard;
            lost += packet.lost_before().value();
            auto got = co_await doubler.try_call(twice, number{1}, 1s);
            ++calls;
            if (!got) ++failed_calls;
        }
    });
    auto whole = [&] {
        return it.server->running() &&
               std::ranges::all_of(paths, [&](const std::string& path) { return it.holds(path); });
    };
    REQUIRE(it.world.run_until([&] { return whole() && heard > 3; }, 10s));
    std::vector<std::uint64_t> epochs;
    for (const auto& path : paths) epochs.push_back(it.epoch_of(path));

    it.server->crash();
    it.world.run_for(away);
    it.restart_server();
    CHECK(it.world.run_until(whole, 4s));
    for (std::size_t i = 0; i < paths.size(); ++i) CHECK(it.epoch_of(paths[i]) == epochs[i]);
    it.world.run_for(5s);
    CHECK(whole());
    CHECK(lost == 0);
    CHECK(failed_calls == 0);
    CHECK(calls > 50);
}

TEST_CASE("names: while the server is away a client reconnects to where the component was") {
    names_test::system it;
    it.start_doubler("boat", "atirma/doubler");
    std::int64_t answers = 0;
    it.start_body("shore", "console", [&](ise::component& self) -> ise::task<> {
        auto doubler = co_await self.find("atirma/doubler");
        for (;;) {
            auto got = co_await doubler.try_call(twice, number{1}, 30s);
            if (got) ++answers;
            co_await self.sleep(100ms);
        }
    });
    REQUIRE(it.world.run_until([&] { return answers > 3; }, 5s));
    it.server->crash();
    it.world.run_for(30s);
    it.world.net().cut("shore", "boat", ise::sim::direction::to_server, 100); // the next one
    it.world.net().partition("shore", "boat");
    it.world.run_for(20s);
    it.world.net().heal("shore", "boat");
    auto before = answers;
    CHECK(it.world.run_until([&] { return answers > before + 5; }, 30s));
}

TEST_CASE("names: a holder that was cut off keeps serving, and withdraws when it was superseded meanwhile") {
    names_test::system it;
    ise::node* old = nullptr;
    it.start("boat", "boat", [&](ise::node& node) {
        old = &node;
        node.start<doubler>("atirma/doubler", everywhere());
    });
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
    auto epoch = it.epoch_of("atirma/doubler");
    std::int64_t answers = 0;
    it.start_body("boat2", "console", [&](ise::component& self) -> ise::task<> {
        auto doubler = co_await self.find("atirma/doubler");
        for (;;) {
            auto got = co_await doubler.try_call(twice, number{1}, 1s);
            if (got) ++answers;
            co_await self.sleep(100ms);
        }
    });
    REQUIRE(it.world.run_until([&] { return answers > 3; }, 5s));
    it.world.net().partition("boat", "ns");
    it.world.run_for(10s);
    CHECK_FALSE(it.holds("atirma/doubler"));
    auto before = answers;
    it.world.run_for(5s);
    CHECK(answers > before + 20); // the session lives

    SECTION("nobody took the name: it has it again, as before") {
        it.world.net().heal("boat", "ns");
        CHECK(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 10s));
        CHECK(it.epoch_of("atirma/doubler") == epoch);
        CHECK_FALSE(old->all_stopped());
    }
    SECTION("another took it") {
        it.start_doubler("spare", "atirma/doubler");
        REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
        auto higher = it.epoch_of("atirma/doubler");
        CHECK(higher > epoch);
        it.world.net().heal("boat", "ns");
        REQUIRE(it.world.run_until([&] { return old->all_stopped(); }, 15s));
        CHECK(old->reports().at(0).failure.find("another took this name over") != std::string::npos);
        CHECK(it.epoch_of("atirma/doubler") == higher);
        before = answers;
        CHECK(it.world.run_until([&] { return answers > before + 5; }, 15s)); // with the new one
    }
}

TEST_CASE("names: a node whose lease was over tells all its names again, also when only one of them has news") {
    names_test::system it;
    ise::component* busy = nullptr;
    it.start("boat", "boat", [&](ise::node& node) {
        node.start<doubler>("a/quiet", everywhere());
        busy = &node.start<doubler>("a/busy", everywhere());
    });
    REQUIRE(it.world.run_until([&] { return it.holds("a/quiet") && it.holds("a/busy"); }, 5s));
    it.world.run_for(1s);

    SECTION("it was cut off for longer than its lease") {
        it.world.net().partition("boat", "ns");
        it.world.run_for(10s);
        REQUIRE_FALSE(it.holds("a/quiet"));
        busy->require(twice);
        it.world.net().heal("boat", "ns");
    }
    SECTION("and the first answer was lost") {
        it.world.net().partition("boat", "ns");
        it.world.run_for(10s);
        it.server->pause();
        busy->require(twice);
        it.world.net().heal("boat", "ns");
        it.world.run_for(3s);
        it.server->go_on();
    }
    SECTION("the server was restarted") {
        it.restart_server();
        busy->require(twice);
    }
    CHECK(it.world.run_until([&] { return it.holds("a/quiet") && it.holds("a/busy"); }, 10s));
}

TEST_CASE("names: of two holders that come back to a restarted server the one with the lower epoch withdraws") {
    names_test::system it;
    ise::node* old = nullptr;
    it.start("boat", "boat", [&](ise::node& node) {
        old = &node;
        node.start<doubler>("atirma/doubler", everywhere());
    });
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
    it.world.run_for(1s); // the answer is there
    it.world.net().partition("boat", "ns");
    REQUIRE(it.world.run_until([&] { return !it.holds("atirma/doubler"); }, 5s));
    it.start_doubler("spare", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
    auto higher = it.epoch_of("atirma/doubler");

    it.world.run_for(1s);
    it.world.net().partition("spare", "ns");
    it.server->crash();
    it.world.net().heal("boat", "ns");
    it.world.run_for(5s);
    it.restart_server();
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 15s));
    CHECK(it.epoch_of("atirma/doubler") < higher); // it cannot be known yet
    it.world.net().heal("spare", "ns");
    REQUIRE(it.world.run_until([&] { return old->all_stopped(); }, 15s));
    CHECK(old->reports().at(0).failure.find("another took this name over") != std::string::npos);
    CHECK(it.epoch_of("atirma/doubler") == higher);
}

TEST_CASE("names: a watch begins with a snapshot and tells every change below its prefix") {
    names_test::system it;
    it.start_doubler("boat", "atirma/doubler");
    it.start_doubler("other", "else/doubler");
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler") && it.holds("else/doubler"); }, 5s));
    std::vector<std::string> seen;
    std::uint64_t lost = 0;
    it.start_body("shore", "watcher", [&](ise::component& self) -> ise::task<> {
        auto server = name_server_of(self);
        ise::naming::watch_request request;
        request.prefix = "atirma";
        auto options = ise::subscribe_options::keep_last(64);
        auto changes = co_await server.subscribe(ise::naming::watch, request, options);
        for (;;) {
            auto packet = co_await changes.next();
            if (!packet) break;
            lost += packet.lost_before().value_or(0);
            if (packet->snapshot) seen.push_back("snapshot");
            for (const auto& event : packet->events)
                seen.push_back((event.what == ise::naming::name_change::added     ? "+"
                                : event.what == ise::naming::name_change::removed ? "-"
                                                                                  : "~") +
                               event.name.path);
        }
    });
    using list = std::vector<std::string>;
    CHECK(it.world.run_until([&] { return seen == list{"snapshot", "+atirma/doubler"}; }, 5s));
    seen.clear();
    auto& second = it.start_doubler("boat2", "atirma/second");
    CHECK(it.world.run_until([&] { return seen == list{"+atirma/second"}; }, 5s));
    it.start_doubler("boat3", "else/third");
    it.world.run_for(1s);
    second.crash();
    CHECK(it.world.run_until([&] { return seen == list{"+atirma/second", "-atirma/second"}; }, 5s));
    seen.clear();
    CHECK(lost == 0);

    it.restart_server();
    REQUIRE(it.world.run_until([&] { return std::ranges::count(seen, "snapshot") > 0; }, 10s));
    CHECK(it.world.run_until([&] { return std::ranges::count(seen, "+atirma/doubler") == 1; }, 10s));
}

TEST_CASE("names: lists and descriptions tell what a component offers") {
    names_test::system it;
    it.start_doubler("boat", "atirma/doubler");
    std::optional<ise::naming::describe_response> described;
    std::size_t listed = 0;
    it.start_body("shore", "cli", [&](ise::component& self) -> ise::task<> {
        co_await self.find("atirma/doubler");
        auto server = name_server_of(self);
        ise::naming::list_request all;
        auto names = co_await server.call(ise::naming::list, all, 2s);
        listed = names.names.size();
        ise::naming::describe_request one;
        one.path = "atirma/doubler";
        described = co_await server.call(ise::naming::describe, one, 2s);
    });
    REQUIRE(it.world.run_until([&] { return described.has_value(); }, 10s));
    CHECK(listed == 2);
    CHECK(described->name.host_name == "boat");
    CHECK(described->name.state == "ready");
    CHECK(described->name.type == "names_test::doubler");
    CHECK(described->lease == 2s);
    bool found = false;
    for (const auto& service : described->services) {
        if (service.name != "twice") continue;
        found = true;
        auto text =
            std::ranges::find(described->schemas, service.fingerprints.at(0), &ise::naming::schema_text::fingerprint);
        REQUIRE(text != described->schemas.end());
        CHECK(text->text == ise::schema_of<number>().text());
    }
    CHECK(found);
}

TEST_CASE("names: restarts, losses and partitions leave every living component registered") {
    auto seed = GENERATE(range(1u, 9u));
    CAPTURE(seed);
    names_test::system it(true, seed);
    std::vector<ise::sim::process*> boats;
    for (int i = 0; i < 5; ++i)
        boats.push_back(&it.start_doubler("boat" + std::to_string(i), "fleet/boat" + std::to_string(i)));
    for (int i = 0; i < 5; ++i) {
        it.world.net().between("boat" + std::to_string(i), "ns").loss = 0.05;
        it.world.at(std::chrono::seconds(5 + 7 * i),
                    [&, i] { boats[static_cast<std::size_t>(i)] = &boats[static_cast<std::size_t>(i)]->restart(); });
        it.world.at(std::chrono::seconds(8 + 9 * i), [&] { it.restart_server(); });
        it.world.at(std::chrono::seconds(11 + 8 * i),
                    [&, i] { it.world.net().partition("boat" + std::to_string(i), "ns"); });
        it.world.at(std::chrono::seconds(17 + 8 * i),
                    [&, i] { it.world.net().heal("boat" + std::to_string(i), "ns"); });
    }
    it.world.run_for(60s);
    CHECK(it.world.run_until(
        [&] {
            for (int i = 0; i < 5; ++i)
                if (!it.holds("fleet/boat" + std::to_string(i))) return false;
            return true;
        },
        20s));
}

TEST_CASE(
    "a component that a name server does not register yet logs the cause: here, that the server has just started") {
    names_test::system it;
    it.server->crash();
    it.start_doubler("boat", "atirma/doubler");
    it.world.run_for(1min);
    it.restart_server();
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 1min));
    auto result = std::ranges::find_if(it.warnings, [](const std::string& line) {
        return line.find("does not register this component yet") != line.npos;
    });
    REQUIRE(result != it.warnings.end());
    CHECK_THAT(*result, ise_test::Contains("the name server has just started"));
    CHECK_THAT(*result, !ise_test::Contains("no room"));
}

} // namespace stories_test
