#include "shore.hpp"

#include <ise/component/introspection.hpp>

#include <components/communication_node/services.hpp>
#include <components/web_server/web_component.hpp>

#include <support/catch.hpp>

#include <nlohmann/json.hpp>

using namespace communication_test;
using ise_test::Contains;

namespace {

bool includes(const std::set<packet_key>& all, const std::set<packet_key>& some) {
    return std::ranges::includes(all, some);
}

// Both nodes serve, the boat sends over two links at once, somebody listens to the role.
struct usual : shore {
    explicit usual(std::uint64_t seed = 1) : shore(seed) {
        start_node(one);
        start_node(two);
        REQUIRE(until([&] { return serves(one) && serves(two); }, 30s));
        seen = &listen();
        sends_every_second({link_id::xbee, link_id::gprs});
        REQUIRE(until([&] { return seen->heard.size() >= 5; }, 30s));
    }
    // What was sent until now is everywhere.
    void settle(ise::duration within = 60s) {
        stop_sending();
        world.run_for(2s);
        auto all = boat.sequence;
        CHECK(until([&] { return seen->known.size() == all; }, within));
        CHECK(until([&] { return boat.acknowledged.size() == all; }, within));
        CHECK(seen->heard.size() == all);
        CHECK(seen->twice == 0);
        CHECK(seen->backwards == 0);
        for (const auto& name : {one, two}) {
            if (!process(name).running()) continue;
            for (const auto& key : boat.acknowledged) {
                CAPTURE(name, key.second);
                CHECK(on_disk(name).contains(key));
            }
            CHECK(state(name).trouble == "");
        }
    }
    listener* seen = nullptr;
};

} // namespace

TEST_CASE("communication: a node declares what it needs of the proxies and of the other node, and uses it") {
    usual it;
    it.settle();
    auto info = it.ask("operator", ise::describe_service, ise::describe_request(), 20s, one);
    REQUIRE(info);
    std::set<std::string> needed;
    for (const auto& service : info->services)
        if (!service.provided && service.declared) needed.insert(service.name);
    CHECK(needed ==
          std::set<std::string>{"replication", "telecommand", "telecommand_recall", "telecommand_state", "telemetry"});
    CHECK(info->waits.empty());
    std::set<std::string> of_the_other, of_a_proxy;
    for (const auto& session : info->sessions) {
        auto& used = session.peer.starts_with(two + " ") ? of_the_other : of_a_proxy;
        used.insert(session.uses.begin(), session.uses.end());
    }
    CHECK(of_the_other.contains("replication"));
    CHECK_FALSE(of_the_other.contains("telemetry"));
    CHECK(of_a_proxy.contains("telemetry"));
    CHECK(of_a_proxy.contains("telecommand_state"));
    CHECK_FALSE(of_a_proxy.contains("replication"));
}

TEST_CASE("communication: a packet over several links is one, at the node and at whoever follows the role") {
    usual it;
    it.world.run_for(20s);
    it.settle();
    for (const auto& name : {one, two}) {
        auto state = it.state(name);
        CHECK(state.packets == it.boat.sequence);
        CHECK(state.shown == it.boat.sequence);
        CHECK(state.duplicates > 0);
        CHECK(state.peer_lives);
        CHECK(state.peer_misses == 0);
        REQUIRE(state.fix);
        CHECK(state.fix->latitude_deg == Approx(28.15 + it.boat.sequence * 1e-6).margin(1e-7));
    }
}

TEST_CASE("communication: the newest fix wins, what comes late over a slow link is history and fills the track") {
    usual it;
    it.world.run_for(3s);
    it.stop_sending();
    it.world.run_for(3s);
    auto newest = *it.seen->current;
    auto late = it.boat.make(link_id::iridium, newest - 10min); // not marked by the boat
    it.boat.over(link_id::iridium).waiting.push_back(late);
    REQUIRE(it.until([&] { return it.seen->known.contains(key_of(late)); }, 10s));
    CHECK(it.seen->backwards == 0);
    CHECK(*it.seen->current == newest);
    CHECK(it.state(one).fix->measured_at == newest);
    CHECK(it.state(one).fix->link != link_id::iridium);
    auto newer = it.boat.make(link_id::iridium, newest + 30s);
    it.boat.over(link_id::iridium).waiting.push_back(newer);
    REQUIRE(it.until([&] { return *it.seen->current == newer.measured_at; }, 10s));
    CHECK(it.state(one).fix->link == link_id::iridium);
}

TEST_CASE("communication: the primary dies, the role goes on through the secondary and comes back, nothing lost, "
          "nothing twice") {
    usual it;
    it.world.run_for(5s);
    auto before = it.seen->heard.size();
    SECTION("its process is killed") { it.crash(one); }
    SECTION("it is frozen, and goes on later") {
        it.process(one).pause();
        it.world.run_for(20s);
        CHECK(it.seen->heard.size() >= before + 12);
        it.process(one).go_on();
        it.world.run_for(30s);
        it.settle();
        return;
    }
    it.world.run_for(10s);
    CHECK(it.seen->heard.size() >= before + 5);            // within seconds
    CHECK(it.boat.over(link_id::gprs).waiting.size() < 5); // the boat is acknowledged again
    CHECK_FALSE(it.state(two).peer_lives);
    it.start_node(one);
    REQUIRE(it.until([&] { return it.serves(one); }, 20s));
    CHECK(includes(it.on_disk(one), it.on_disk(two))); // it has caught up before it offers itself
    it.world.run_for(15s);
    it.settle();
    CHECK(it.on_disk(one) == it.on_disk(two));
}

TEST_CASE("communication: the secondary dies, the primary goes on alone and brings it up to date when it is back") {
    usual it;
    it.crash(two);
    auto before = it.boat.acknowledged.size();
    it.world.run_for(15s);
    CHECK(it.boat.acknowledged.size() >= before + 8);
    CHECK(it.serves(one));
    it.start_node(two);
    it.world.run_for(10s);
    it.settle();
    CHECK(it.on_disk(one) == it.on_disk(two));
}

TEST_CASE("communication: a node that is stopped in order does not take the other one with it") {
    usual it;
    bool first = GENERATE(true, false);
    auto& leaves = first ? one : two;
    auto& stays = leaves == one ? two : one;
    it.stop(leaves);
    it.world.run_for(15s);
    it.crash(leaves); // what is left of its process
    CHECK(it.serves(stays));
    auto before = it.boat.acknowledged.size();
    it.world.run_for(10s);
    CHECK(it.boat.acknowledged.size() > before + 5);
    it.start_node(leaves);
    it.world.run_for(15s);
    it.settle();
}

TEST_CASE("communication: both nodes are killed in turn, again and again") {
    usual it(3);
    for (int round = 0; round < 4; ++round) {
        auto& victim = round % 2 ? two : one;
        it.crash(victim);
        it.world.run_for(8s);
        it.start_node(victim);
        REQUIRE(it.until([&] { return it.serves(one) && it.serves(two) && it.state(victim).peer_lives; }, 30s));
        it.world.run_for(3s);
    }
    it.settle();
}

TEST_CASE("communication: while nobody lives the boat is not acknowledged, and sends again what nobody has") {
    usual it;
    it.crash(one);
    it.crash(two);
    it.world.run_for(1s);
    auto acknowledged = it.boat.acknowledged.size();
    it.world.run_for(30s);
    CHECK(it.boat.acknowledged.size() == acknowledged);
    it.start_node(two);
    it.world.run_for(10s);
    it.start_node(one);
    it.world.run_for(20s);
    it.settle();
}

TEST_CASE("communication: nodes that cannot see each other each go on, and are one again afterwards") {
    usual it;
    it.world.net().partition("one", "two");
    it.world.run_for(20s);
    CHECK_FALSE(it.state(one).peer_lives);
    CHECK_FALSE(it.state(two).peer_lives);
    CHECK(it.seen->twice == 0);
    it.crash(one); // whoever followed it goes to the other one, which never heard what it told meanwhile
    it.world.run_for(10s);
    it.start_node(one);
    it.world.run_for(10s);
    it.world.net().heal("one", "two");
    it.world.run_for(20s);
    it.settle();
    CHECK(it.on_disk(one) == it.on_disk(two));
}

TEST_CASE("communication: the boat is acknowledged once a packet is on both disks, or the other node is silent") {
    shore it;
    it.start_node(one);
    it.start_node(two);
    REQUIRE(it.until([&] { return it.serves(one) && it.serves(two); }, 30s));
    keep_request request;
    request.packets.push_back(it.boat.make(link_id::gprs, utc_time(1'504'512'000'000ms)));
    auto kept = it.ask("proxy", services::telemetry_store, request);
    REQUIRE(kept);
    CHECK(kept->fresh == 1);
    CHECK(kept->copies == 2);
    CHECK(it.on_disk(two).size() == 1);
    CHECK(it.ask("proxy", services::telemetry_store, request)->fresh == 0); // known is kept
    it.crash(two);
    request.packets.push_back(it.boat.make(link_id::gprs, utc_time(1'504'512'001'000ms)));
    kept = it.ask("proxy", services::telemetry_store, request);
    REQUIRE(kept);
    CHECK(kept->fresh == 1);
    CHECK(kept->copies == 1);
    request.packets.front().raw.clear();
    auto refused = it.ask("proxy", services::telemetry_store, request);
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == ise::errc::refused);
    CHECK_THAT(refused.error().message(), Contains("0 raw bytes"));
    request.packets.assign(300, it.boat.make(link_id::gprs, utc_time(1'504'512'002'000ms)));
    CHECK_THAT(it.ask("proxy", services::telemetry_store, request).error().message(), Contains("ask in parts"));
}

TEST_CASE("communication: a node whose disk is full leaves the role to the other, and comes back with everything") {
    usual it;
    it.fill_disk(one, true);
    REQUIRE(it.until([&] { return !it.serves(one); }, 10s));
    CHECK_THAT(it.state(one).trouble, Contains("locked"));
    auto before = it.seen->heard.size();
    auto acknowledged = it.boat.acknowledged.size();
    it.world.run_for(20s);
    CHECK(it.seen->heard.size() >= before + 12);
    CHECK(it.boat.acknowledged.size() >= acknowledged + 10);
    CHECK(it.state(one).held > 0);
    it.fill_disk(one, false);
    REQUIRE(it.until([&] { return it.serves(one); }, 20s));
    CHECK(it.state(one).held == 0);
    it.world.run_for(10s);
    it.settle();
    CHECK(it.on_disk(one) == it.on_disk(two));
}

TEST_CASE(
    "communication: with both disks full nothing is acknowledged, and nothing is lost once they take packets again") {
    usual it;
    it.fill_disk(one, true);
    it.fill_disk(two, true);
    it.world.run_for(3s);
    auto acknowledged = it.boat.acknowledged.size();
    it.world.run_for(20s);
    CHECK(it.boat.acknowledged.size() == acknowledged);
    keep_request request;
    request.packets.push_back(it.boat.make(link_id::gprs, utc_time(1'504'512'001'000ms)));
    --it.boat.sequence;
    auto refused = it.ask("proxy", services::telemetry_store, request);
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == ise::errc::refused);
    CHECK_THAT(refused.error().message(), Contains("do not acknowledge"));
    it.fill_disk(one, false);
    it.fill_disk(two, false);
    it.world.run_for(20s);
    it.settle();
}

TEST_CASE("communication: what a full disk makes wait is bounded, and the oldest of it goes") {
    shore it(1, false);
    it.terms.max_held = 10;
    it.start_node(one);
    REQUIRE(it.until([&] { return it.serves(one); }, 30s));
    it.world.run_for(2s);
    it.fill_disk(one, true);
    it.sends_every_second({link_id::xbee});
    it.world.run_for(30s);
    CHECK(it.state(one).held == 10);
    CHECK(it.state(one).dropped >= 15);
    CHECK(it.serves(one)); // there is no other: it says why it cannot
    it.stop_sending();
    it.fill_disk(one, false);
    REQUIRE(it.until([&] { return it.state(one).packets == 10; }, 10s));
    CHECK(it.state(one).trouble == "");
}

TEST_CASE("communication: two primaries, or two nodes with one file, say so instead of telling each other") {
    shore it;
    it.start_node(one);
    it.names.start("three", "three", [&](ise::node& node) {
        communication_node_options options;
        options.file = "memory:another-primary";
        options.peer = one;
        node.start<communication_node>("shore/three", names_test::everywhere(), std::move(options));
    });
    auto answer = it.ask(
        "ana", services::replication,
        [] {
            replication_request request;
            request.node = "shore/three";
            return request;
        }(),
        20s, one);
    REQUIRE_FALSE(answer);
    CHECK_THAT(answer.error().message(), Contains("are both primary") && Contains("start one of them as secondary"));
}

TEST_CASE("communication: a page that is restarted shows the track that it missed") {
    usual it;
    it.world.run_for(20s);
    web_server* page = nullptr;
    auto start = [&](ise::node& node) {
        web_server_options options;
        options.telemetry = {std::string(communication_role)};
        page = &node.start<web_server>("shore/page", names_test::everywhere(), std::move(options));
    };
    auto& process = it.names.start("pages", "pages", start);
    it.world.run_for(5s);
    it.stop_sending();
    it.world.run_for(3s);
    CHECK(page->statistics().received == it.boat.sequence);
    process.crash();
    it.names.start("pages", "pages", start);
    REQUIRE(it.until([&] { return page->statistics().received == it.boat.sequence; }, 20s));
    CHECK(page->state().track().size() >= 2);
    CHECK(page->statistics().duplicates == 0);
    REQUIRE(page->state().position());
    // The newest measurement, also where it came as history: here of a link that says nothing about when it was
    // received.
    CHECK(page->state().position()->latitude_deg == Approx(28.15 + it.boat.sequence * 1e-6).epsilon(1e-9));
}

TEST_CASE("communication: a page with an archive shows its track at once after a crash, and asks only for what came "
          "meanwhile") {
    usual it;
    auto disk = ise::database::open("memory:page-archive", {}).value(); // outlives the page
    web_server* page = nullptr;
    auto start = [&](ise::node& node) {
        web_server_options options;
        options.telemetry = {std::string(communication_role)};
        options.archive.file = "memory:page-archive";
        page = &node.start<web_server>("shore/page", names_test::everywhere(), std::move(options));
    };
    auto& process = it.names.start("pages", "pages", start);
    it.world.run_for(20s);
    it.settle();
    it.world.run_for(3s); // and it is on the disk
    auto kept = it.boat.sequence;
    REQUIRE(page->statistics().received == kept);
    auto track = page->state().track().size();
    auto sailed = page->state().sailed_m();
    auto current = *page->state().position();
    process.crash();
    it.crash(one);
    it.crash(two);

    it.names.start("pages", "pages", start);
    it.world.run_for(2s);
    CHECK(page->statistics().received == 0); // nobody is there who could tell anything
    CHECK(page->state().track().size() == track);
    CHECK(page->state().sailed_m() == Approx(sailed));
    REQUIRE(page->state().position());
    CHECK(page->state().position()->from.measured_at == current.from.measured_at);
    CHECK(page->state().position()->from.source == current.from.source);

    it.start_node(one);
    it.start_node(two);
    it.sends_every_second({link_id::xbee, link_id::gprs});
    REQUIRE(it.until([&] { return it.boat.sequence >= kept + 5; }));
    it.settle();
    REQUIRE(it.until([&] { return page->statistics().received >= it.boat.sequence - kept; }));
    CHECK(page->statistics().received == it.boat.sequence - kept);
    CHECK(page->statistics().duplicates == 0);
    CHECK(page->state().track().size() > track);
}

TEST_CASE("communication: a page that follows the role shows each link, and which node tells of it") {
    usual it;
    web_server* page = nullptr;
    it.names.start("pages", "pages", [&](ise::node& node) {
        web_server_options options;
        options.telemetry = {std::string(communication_role)};
        page = &node.start<web_server>("shore/page", names_test::everywhere(), std::move(options));
    });
    auto feed = [&](const std::string& source) -> nlohmann::json {
        auto state = nlohmann::json::parse(page->state().snapshot({}, {}).data)["state"];
        for (auto& each : state["feeds"])
            if (each["source"] == source) return each;
        return {{"connected", nullptr}};
    };
    auto heard = [&](const std::string& source) {
        return nlohmann::json::parse(page->state().snapshot({}, {}).data)["state"]["heard"].value(source, 0ull);
    };
    REQUIRE(it.until([&] { return feed("xbee")["connected"] == true && feed("gprs")["connected"] == true; }));
    CHECK(feed("communication")["link"] == false);
    CHECK(feed("communication")["detail"] == "one, backed by two");
    auto before = heard("gprs");
    CHECK(before > 0);
    REQUIRE(it.until([&] { return heard("gprs") > before; })); // also where the xbee brings every packet first
    it.crash("shore/gprs");
    REQUIRE(it.until([&] { return feed("gprs")["connected"] == false; }));
    CHECK(feed("xbee")["connected"] == true);
    it.crash(one);
    REQUIRE(it.until([&] { return feed("communication")["detail"] == "two, without the other one"; }));
    it.crash(two);
    REQUIRE(it.until([&] { return feed("communication")["connected"] == false; }));
}
