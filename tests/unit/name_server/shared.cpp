// Name servers that share a store, and nodes that know all of them.
#include "system.hpp"

#include <support/model_store.hpp>

#include <fmt/format.h>

#include <map>
#include <random>

namespace shared_test {

using namespace names_test;

namespace {

class shared_system {
public:
    explicit shared_system(std::size_t servers = 3, std::uint64_t seed = 1,
                           ise::registry_limits limits = ise::registry_limits())
        : world(seed) {
        cluster.clock = [this] { return world.now(); };
        for (std::size_t i = 0; i != servers; ++i) {
            auto host = fmt::format("ns{}", i);
            list += (i == 0 ? "tcp://" : ",tcp://") + world.host(host).address() + ":7400";
            names.push_back(nullptr);
            process.push_back(&world.host(host).start_process("names", [this, i, host, limits](ise::sim::process& env) {
                auto options = node_options();
                options.use_names = false;
                auto made = std::make_shared<program>(env, std::move(options));
                ise::component_options where;
                where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7400").value()};
                where.registers = false;
                ise::name_server_options terms;
                terms.limits = limits;
                terms.store = [this, host](ise::environment&, ise::loop& on) {
                    return std::make_unique<ise_test::model_store>(cluster, on, host);
                };
                names[i] = &made->node.start<ise::name_server>(std::string(ise::naming::server_path), where, terms);
                return made;
            }));
        }
    }
    ise::sim::process& start(const std::string& host, const std::string& name, std::function<void(ise::node&)> begin) {
        auto run = [begin, this](ise::sim::process& env) {
            auto options = node_options();
            options.log = [this, print = options.log](const ise::log_record& record) {
                if (record.level >= ise::log_level::warning) warnings.push_back(ise::format_line(record));
                print(record);
            };
            auto made = std::make_shared<program>(env, std::move(options));
            begin(made->node);
            return made;
        };
        return world.host(host).start_process(name, run, {{"ISE_NAME_SERVER", list}});
    }
    ise::sim::process& start_doubler(const std::string& host, const std::string& path, int priority = -1) {
        return start(host, "doubler", [path, priority](ise::node& node) {
            auto how = everywhere();
            if (priority >= 0) how.roles["atirma/lead"] = priority;
            node.start<doubler>(path, std::move(how));
        });
    }
    std::uint64_t epoch_at(std::size_t server, const std::string& path) const {
        if (!process[server]->running() || !names[server]->names()) return 0;
        for (const auto& event : names[server]->names()->snapshot(path))
            if (event.name.path == path) return event.name.epoch;
        return 0;
    }
    bool held_everywhere(const std::string& path) const {
        for (std::size_t i = 0; i != names.size(); ++i)
            if (epoch_at(i, path) == 0) return false;
        return true;
    }
    bool warned(const std::string& of) const {
        return std::ranges::any_of(warnings, [&](const auto& line) { return line.find(of) != line.npos; });
    }

    ise_test::model_cluster cluster; // these outlive the world
    std::vector<std::string> warnings;
    std::string list;
    int desks = 0;
    std::vector<ise::name_server*> names;
    ise::sim::world world;
    std::vector<ise::sim::process*> process;
};

// Calls the doubler ten times a second; counts what was answered, and when last.
struct caller {
    std::int64_t answers = 0, failures = 0;
    body run(const std::string& path) {
        return [this, path](ise::component& self) -> ise::task<> {
            auto there = self.at(path);
            for (;;) {
                number asked{1};
                auto got = co_await there.try_call(twice, asked, 2s);
                ++(got ? answers : failures);
                co_await self.sleep(100ms);
            }
        };
    }
};

// What the first name server lists as its trouble.
std::string trouble_listed(shared_system& it) {
    std::optional<std::string> trouble;
    auto name = "desk" + std::to_string(it.desks++);
    it.start(name, name, [&](ise::node& node) {
        node.start(
            "test/" + name,
            [&](ise::component& self) -> ise::task<> {
                ise::naming::list_request all;
                auto server = self.at(ise::endpoint::parse(it.list.substr(0, it.list.find(','))).value());
                auto response = co_await server.call(ise::naming::list, all, 5s);
                trouble = response.trouble;
            },
            everywhere());
    });
    CHECK(it.world.run_until([&] { return trouble.has_value(); }, 10s));
    return trouble.value_or("no answer");
}

} // namespace

TEST_CASE("shared names: what one name server grants is found at all, under the same epoch") {
    shared_system it;
    it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    it.warnings.clear(); // of its first question, before the store was read
    auto epoch = it.epoch_at(0, "atirma/doubler");
    CHECK(it.epoch_at(1, "atirma/doubler") == epoch);
    CHECK(it.epoch_at(2, "atirma/doubler") == epoch);
    it.world.run_for(60s);
    CHECK(it.epoch_at(2, "atirma/doubler") == epoch);
    for (const auto& line : it.warnings) UNSCOPED_INFO(line);
    CHECK(it.warnings.empty());
}

TEST_CASE("shared names: only the name server that keeps a lease tells when it was renewed") {
    shared_system it;
    it.world.run_for(1s); // then all name servers have read the store, and nodes stay at the first one
    it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    it.world.run_for(10s);
    for (const std::string name_server : {"ns0", "ns2"}) {
        CAPTURE(name_server);
        ise::naming::describe_response described;
        ise::naming::list_response listed;
        bool answered = false;
        it.start(name_server, "desk", [&](ise::node& node) {
            node.start(
                "test/" + name_server,
                [&](ise::component& self) -> ise::task<> {
                    auto at = "tcp://" + it.world.host(name_server).address() + ":7400";
                    auto server = self.at(ise::endpoint::parse(at).value());
                    ise::naming::describe_request of;
                    of.path = "atirma/doubler";
                    described = co_await server.call(ise::naming::describe, of, 5s);
                    ise::naming::list_request below;
                    below.prefix = "atirma";
                    listed = co_await server.call(ise::naming::list, below, 5s);
                    answered = true;
                },
                everywhere());
        });
        REQUIRE(it.world.run_until([&] { return answered; }, 5s));
        CHECK(described.lease == (name_server == "ns0" ? ise::duration(2s) : ise::duration()));
        CHECK(described.lease_age <= ise::duration(1s));
        CHECK(listed.names.at(0).lease_age <= ise::duration(1s));
    }
}

TEST_CASE("shared names: when a node dies its name is free within the lease, and the next grant has a higher epoch") {
    shared_system it;
    auto& boat = it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    auto before = it.epoch_at(0, "atirma/doubler");
    boat.crash();
    CHECK(it.world.run_until([&] { return it.epoch_at(2, "atirma/doubler") == 0; }, 3s));
    CHECK(it.world.run_until([&] { return it.cluster.leases.empty(); }, 100ms));
    it.start_doubler("shore", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    CHECK(it.epoch_at(1, "atirma/doubler") > before);
}

TEST_CASE("shared names: a name that is stopped in order is free at once, with its lease in the store") {
    shared_system it;
    ise::node* boat = nullptr;
    it.start("boat", "doubler", [&](ise::node& node) {
        boat = &node;
        node.start<doubler>("atirma/doubler", everywhere());
    });
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    boat->stop();
    CHECK(
        it.world.run_until([&] { return it.epoch_at(2, "atirma/doubler") == 0 && it.cluster.leases.empty(); }, 500ms));
}

TEST_CASE("shared names: who wants a held name at another name server is told who has it") {
    shared_system it;
    it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    auto comma = it.list.find(',');
    it.list = it.list.substr(comma + 1) + "," + it.list.substr(0, comma); // it begins with the next name server
    ise::node* second = nullptr;
    it.start("shore", "thief", [&](ise::node& node) {
        second = &node;
        node.start<doubler>("atirma/doubler", everywhere());
    });
    it.world.run_for(60s);
    auto first = it.epoch_at(0, "atirma/doubler");
    CHECK(first != 0);
    for (const auto& line : it.warnings) UNSCOPED_INFO(line);
    CHECK(second->all_stopped());
}

TEST_CASE(
    "shared names: nodes, lookups and roles go on with the next name server when theirs is killed, stopped or cut "
    "off from the store") {
    auto fault = GENERATE(std::string("killed"), std::string("stopped"), std::string("cut off"), std::string("slow"));
    CAPTURE(fault);
    shared_system it;
    it.start_doubler("boat", "atirma/doubler");
    it.start_doubler("first", "atirma/first", 100);
    it.start_doubler("second", "atirma/second", 50);
    caller calls, of_role;
    it.start("shore", "caller", [&](ise::node& node) {
        node.start("test/caller", calls.run("atirma/doubler"), everywhere());
        node.start("test/role", of_role.run("atirma/lead"), everywhere());
    });
    REQUIRE(it.world.run_until([&] { return calls.answers > 10 && of_role.answers > 10; }, 10s));
    it.world.run_for(5s);
    auto epoch = it.epoch_at(1, "atirma/doubler");
    REQUIRE(epoch != 0);
    if (fault == "killed") it.process[0]->crash();
    if (fault == "stopped") it.process[0]->pause();
    if (fault == "cut off") it.cluster.cut_off.insert("ns0");
    if (fault == "slow") it.cluster.latency["ns0"] = 3s;
    it.start("late", "late", [&](ise::node& node) { node.start<doubler>("atirma/late", everywhere()); });
    // Somebody new is granted a name, and found.
    CHECK(it.world.run_until([&] { return it.epoch_at(1, "atirma/late") != 0; }, 10s));
    it.world.run_for(30s);
    CHECK(it.epoch_at(1, "atirma/doubler") == epoch); // no grant is lost, and none is made twice
    CHECK(it.epoch_at(2, "atirma/doubler") == epoch);
    CHECK(calls.failures == 0);
    CHECK(of_role.failures == 0);
    if (fault == "stopped") it.process[0]->go_on();
    if (fault == "killed") it.process[0] = &it.process[0]->restart();
    it.cluster.cut_off.clear();
    it.cluster.latency.clear();
    it.world.run_for(30s);
    CHECK(it.epoch_at(0, "atirma/doubler") == epoch); // it knows everything again, and takes nothing away
    CHECK(it.epoch_at(0, "atirma/late") != 0);
    CHECK(calls.failures == 0);
}

TEST_CASE("shared names: after all name servers were killed every name is there again under its epoch") {
    shared_system it;
    it.start_doubler("boat", "atirma/doubler");
    it.start_doubler("first", "atirma/first", 100);
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/first"); }, 5s));
    it.world.run_for(5s);
    auto epoch = it.epoch_at(0, "atirma/doubler");
    for (auto* one : it.process) one->crash();
    it.world.run_for(3s);
    for (auto& one : it.process) one = &one->restart();
    CHECK(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 3s));
    it.world.run_for(30s);
    CHECK(it.epoch_at(0, "atirma/doubler") == epoch);
    CHECK(it.epoch_at(2, "atirma/first") != 0);
}

TEST_CASE("shared names: many nodes that come to another name server at once come with few transactions") {
    constexpr int nodes = 100;
    shared_system it;
    auto path = [](int n) { return fmt::format("atirma/doubler{}", n); };
    auto all_held = [&] {
        for (int n = 0; n != nodes; ++n)
            if (!it.held_everywhere(path(n))) return false;
        return true;
    };
    for (const char* name_server : {"ns0", "ns1", "ns2"}) it.cluster.latency[name_server] = 20ms;
    it.world.run_for(1s); // then all name servers have read the store, and nodes stay at the first one
    for (int n = 0; n != nodes; ++n) it.start_doubler(fmt::format("boat{}", n), path(n));
    REQUIRE(it.world.run_until(all_held, 10s));
    it.world.run_for(3s);
    const auto granted = it.cluster.keys;
    const auto before = it.cluster.transactions;
    it.process[0]->crash();
    it.world.run_for(5s);
    for (const auto& [key, one] : granted)
        if (key.starts_with("node/")) CHECK(it.cluster.keys[key].changed > one.changed);
    CHECK(it.cluster.transactions - before < nodes);
    it.world.run_for(15s);
    for (const auto& [key, one] : granted) CHECK(it.cluster.keys[key].created == one.created);
}

TEST_CASE("shared names: without a majority those who have met go on, nobody new is granted, and all say so") {
    shared_system it;
    it.start_doubler("boat", "atirma/doubler");
    caller calls;
    it.start("shore", "caller",
             [&](ise::node& node) { node.start("test/caller", calls.run("atirma/doubler"), everywhere()); });
    REQUIRE(it.world.run_until([&] { return calls.answers > 10; }, 10s));
    auto epoch = it.epoch_at(0, "atirma/doubler");
    it.cluster.majority = false;
    it.start("late", "late", [&](ise::node& node) { node.start<doubler>("atirma/late", everywhere()); });
    it.world.run_for(60s);
    CHECK(calls.failures == 0);
    CHECK(it.epoch_at(0, "atirma/late") == 0);
    CHECK(it.warned("names are unconfirmed"));
    CHECK(trouble_listed(it).find("no majority") != std::string::npos);
    it.cluster.majority = true;
    CHECK(it.world.run_until([&] { return it.held_everywhere("atirma/late"); }, 10s));
    CHECK(it.epoch_at(0, "atirma/doubler") >= epoch);
    CHECK(calls.failures == 0);
}

TEST_CASE("shared names: a store that is away for a while costs no node its names") {
    auto away = GENERATE(1s, 2s, 3s, 4s, 5s, 6s, 30s);
    auto nodes = GENERATE(1, 5);
    CAPTURE(away.count(), nodes);
    shared_system it;
    auto path = [](int n) { return fmt::format("atirma/doubler{}", n); };
    for (int n = 0; n != nodes; ++n) it.start_doubler(fmt::format("boat{}", n), path(n));
    REQUIRE(it.world.run_until([&] { return it.held_everywhere(path(nodes - 1)); }, 5s));
    it.world.run_for(3s);
    std::vector<std::uint64_t> epochs;
    for (int n = 0; n != nodes; ++n) epochs.push_back(it.epoch_at(0, path(n)));
    it.cluster.majority = false;
    it.world.run_for(away);
    it.cluster.majority = true;
    it.world.run_for(15s);
    for (int n = 0; n != nodes; ++n) CHECK(it.epoch_at(0, path(n)) == epochs[static_cast<std::size_t>(n)]);
}

TEST_CASE("shared names: a store that answers too late for grants, and gets all renewals, costs no node its names") {
    auto one_way = GENERATE(800ms, 1000ms, 2400ms);
    auto nodes = GENERATE(1, 60);
    CAPTURE(one_way.count(), nodes);
    shared_system it;
    auto path = [](int n) { return fmt::format("atirma/doubler{}", n); };
    for (int n = 0; n != nodes; ++n) it.start_doubler(fmt::format("boat{}", n), path(n));
    REQUIRE(it.world.run_until([&] { return it.held_everywhere(path(nodes - 1)); }, 5s));
    it.world.run_for(3s);
    const auto before = it.cluster.keys;
    for (const char* name_server : {"ns0", "ns1", "ns2"}) it.cluster.latency[name_server] = one_way;
    it.start_doubler("late", "atirma/late");
    it.world.run_for(60s);
    CHECK(trouble_listed(it).find("etcd did not answer in time") != std::string::npos);
    CHECK(it.warned("names are unconfirmed"));
    it.cluster.latency.clear();
    CHECK(it.world.run_until([&] { return it.held_everywhere("atirma/late"); }, 15s));
    it.world.run_for(15s);
    for (const auto& [key, one] : before)
        if (key.starts_with("name/")) CHECK(it.cluster.keys[key].created == one.created);
    CHECK(trouble_listed(it).empty());
}

TEST_CASE(
    "shared names: a store that is slow at times costs no node its names, whichever name servers it is slow for") {
    auto seed = GENERATE(range(1, 21));
    auto alike = GENERATE(true, false);
    CAPTURE(seed, alike);
    shared_system it(3, static_cast<std::uint64_t>(seed));
    std::mt19937 dice(static_cast<unsigned>(seed));
    const std::vector<std::string> paths = {"crowd/a", "crowd/b", "crowd/c"};
    for (const auto& path : paths) it.start_doubler(path.substr(6), path);
    REQUIRE(it.world.run_until(
        [&] { return std::ranges::all_of(paths, [&](const auto& path) { return it.held_everywhere(path); }); }, 10s));
    it.world.run_for(3s);
    const auto before = it.cluster.keys;
    for (int step = 0; step != 40; ++step) {
        auto slow = [&] { return std::chrono::milliseconds(dice() % 3 == 0 ? 1 : 1 + dice() % 2000); };
        auto all = slow();
        for (const char* name_server : {"ns0", "ns1", "ns2"}) it.cluster.latency[name_server] = alike ? all : slow();
        it.world.run_for(std::chrono::milliseconds(dice() % 4000));
    }
    it.cluster.latency.clear();
    it.world.run_for(20s);
    for (const auto& [key, one] : before)
        if (key.starts_with("name/")) CHECK(it.cluster.keys[key].created == one.created);
}

TEST_CASE("shared names: a node that has died goes from a slow store, too") {
    shared_system it;
    auto& boat = it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    for (const char* name_server : {"ns0", "ns1", "ns2"}) it.cluster.latency[name_server] = 400ms;
    it.world.run_for(10s);
    boat.crash();
    it.world.run_for(5s);
    CHECK(it.epoch_at(0, "atirma/doubler") != 0); // a store that is slow may be what keeps it from renewing
    CHECK(it.world.run_until([&] { return it.epoch_at(2, "atirma/doubler") == 0; }, 15s));
}

TEST_CASE("shared names: who waits for a name whose holder and name server have died gets it") {
    auto known_for = GENERATE(0s, 2s, 4s, 5s, 6s, 8s, 11s, 13s);
    CAPTURE(known_for.count());
    shared_system it;
    it.world.run_for(1s); // then all name servers have read the store, and nodes stay at the first one
    auto& boat = it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    auto before = it.epoch_at(1, "atirma/doubler");
    it.world.run_for(known_for);
    auto comma = it.list.find(',');
    it.list = it.list.substr(comma + 1) + "," + it.list.substr(0, comma); // it begins with the next name server
    it.start_doubler("shore", "atirma/doubler");
    it.world.run_for(1s);
    boat.crash();
    it.process[0]->crash();
    CHECK(it.world.run_until([&] { return it.epoch_at(1, "atirma/doubler") > before; }, 15s));
}

TEST_CASE("shared names: a watch that a compaction has overtaken reads everything anew") {
    shared_system it;
    auto& boat = it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    it.cluster.cut_off.insert("ns2");
    it.world.run_for(2s);
    it.start_doubler("other", "atirma/other");
    boat.crash();
    it.world.run_for(10s);
    it.cluster.compact();
    CHECK(it.epoch_at(2, "atirma/other") == 0);
    it.cluster.cut_off.clear();
    CHECK(it.world.run_until([&] { return it.epoch_at(2, "atirma/other") != 0; }, 5s));
    CHECK(it.epoch_at(2, "atirma/doubler") == 0);
}

TEST_CASE("shared names: name servers go on when their store is restored from an older backup") {
    shared_system it;
    it.start_doubler("boat", "atirma/boat");
    auto& former = it.start_doubler("former", "atirma/former");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/boat") && it.held_everywhere("atirma/former"); },
                               5s));
    auto backup = it.cluster.make_backup();
    former.crash();
    it.start_doubler("other", "atirma/other");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/other"); }, 5s));
    it.world.run_for(30s);
    it.cluster.revision += 1000; // keys of others
    for (int n = 0; n != 5; ++n) it.start_doubler(fmt::format("guest{}", n), fmt::format("atirma/guest{}", n));
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/guest4"); }, 5s));
    const auto watched = GENERATE(true, false); // false: the watch of one is lost before
    if (!watched) it.cluster.cut_off.insert("ns2");
    if (!watched) it.world.run_for(3s);
    it.cluster.restore(std::move(backup));
    it.world.run_for(1s);
    it.cluster.cut_off.clear();
    it.start_doubler("late", "atirma/late");
    it.world.run_for(40s);
    for (const std::string path : {"atirma/boat", "atirma/other", "atirma/guest4", "atirma/late"}) {
        CAPTURE(path);
        CHECK(it.epoch_at(0, path) != 0);
        CHECK(it.cluster.keys.contains("name/" + path));
        CHECK(it.epoch_at(1, path) == it.epoch_at(0, path));
        CHECK(it.epoch_at(2, path) == it.epoch_at(0, path));
    }
    for (std::size_t server = 0; server != 3; ++server) CHECK(it.epoch_at(server, "atirma/former") == 0);
    CHECK(trouble_listed(it).empty());
}

TEST_CASE("shared names: a name server says that its store does not answer though its watch still reports changes") {
    shared_system it;
    it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    it.cluster.unanswered.insert("ns0");
    it.world.run_for(10s);
    for (int n = 0; n != 3; ++n) {
        auto path = fmt::format("atirma/other{}", n);
        it.start_doubler(fmt::format("other{}", n), path);
        CHECK(it.world.run_until([&] { return it.epoch_at(0, path) != 0; }, 15s));
        CHECK(trouble_listed(it).find("etcd did not answer in time") != std::string::npos);
    }
    it.cluster.unanswered.clear();
    it.world.run_for(5s);
    CHECK(trouble_listed(it).empty());
}

TEST_CASE("shared names: a watch that goes mute is noticed, whether or not its name server writes anything") {
    shared_system it;
    it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    it.cluster.mute = {"ns0", "ns1", "ns2"};
    it.world.run_for(100ms);
    CHECK(it.cluster.mute.empty());
    it.start_doubler("other", "atirma/other");
    CHECK(it.world.run_until([&] { return it.held_everywhere("atirma/other"); }, 30s));
    it.world.run_for(10min); // nothing is written but the pulse, by one of them
    const auto before = it.cluster.transactions;
    it.world.run_for(100s);
    CHECK(it.cluster.transactions - before <= 12);
}

TEST_CASE("shared names: the claims of one request, and of requests at once, count together against the limits") {
    ise::registry_limits limits;
    limits.max_components_per_node = 10;
    limits.max_members_per_role = 4;
    shared_system it(1, 1, limits);
    std::map<ise::naming::verdict, int> verdicts;
    int answers = 0;
    it.start("stranger", "stranger", [&](ise::node& node) {
        auto ask = [&](ise::component& self) -> ise::task<> {
            for (int n = 0; n < 4; ++n) {
                self.spawn("claim",
                           [](ise::component& by, int number, std::string list, int& done,
                              std::map<ise::naming::verdict, int>& what) -> ise::task<> {
                               auto server = by.at(ise::endpoint::parse(list).value());
                               ise::naming::register_request request;
                               request.node.lease_key = 99;
                               request.lease = 2s;
                               for (int i = 0; i < 8; ++i) {
                                   auto& claim = request.components.emplace_back();
                                   claim.path = fmt::format("strange/{}/{}", number, i);
                                   claim.incarnation = 1;
                                   if (i % 2 == 0) claim.roles["strange/role"] = i;
                               }
                               co_await by.sleep(1s);
                               auto got = co_await server.try_call(ise::naming::enroll, request, 10s);
                               ++done;
                               if (!got) co_return;
                               for (const auto& one : got->grants) ++what[one.what];
                           }(self, n, it.list, answers, verdicts));
            }
            for (;;) co_await self.sleep(1h);
        };
        node.start("", ask);
    });
    REQUIRE(it.world.run_until([&] { return answers == 4; }, 30s));
    std::size_t held = 0, serving = 0;
    for (const auto& event : it.names[0]->names()->snapshot("strange")) {
        ++held;
        serving += event.name.roles.size();
    }
    CHECK(held <= 10);
    CHECK(held > 3);
    CHECK(serving <= 4);
    CHECK(verdicts[ise::naming::verdict::granted] == static_cast<int>(held));
    CHECK(verdicts[ise::naming::verdict::wait] > 0);
}

TEST_CASE("shared names: nodes beyond max_nodes wait until another has gone, also those that come at once") {
    ise::registry_limits limits;
    limits.max_nodes = 2;
    shared_system it(1, 1, limits);
    std::vector<ise::sim::process*> nodes;
    for (int n = 0; n != 4; ++n)
        nodes.push_back(&it.start_doubler(fmt::format("boat{}", n), fmt::format("atirma/boat{}", n)));
    auto held = [&] {
        std::vector<std::size_t> found;
        for (std::size_t n = 0; n != 4; ++n)
            if (it.epoch_at(0, fmt::format("atirma/boat{}", n)) != 0) found.push_back(n);
        return found;
    };
    it.world.run_for(20s);
    auto before = held();
    REQUIRE(before.size() == 2);
    CHECK(it.names[0]->names()->nodes() == 2);
    CHECK(it.warned("which is max_nodes"));
    nodes[before.front()]->crash();
    CHECK(it.world.run_until(
        [&] {
            auto now = held();
            return now.size() == 2 && now != before;
        },
        30s));
    it.world.run_for(20s);
    CHECK(it.names[0]->names()->nodes() == 2);
}

TEST_CASE("shared names: a store without space grants nothing new, says so, and loses nothing") {
    shared_system it;
    it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.held_everywhere("atirma/doubler"); }, 5s));
    auto epoch = it.epoch_at(0, "atirma/doubler");
    it.cluster.full = true;
    it.start_doubler("other", "atirma/other");
    it.world.run_for(30s);
    CHECK(it.epoch_at(0, "atirma/doubler") == epoch);
    CHECK(it.epoch_at(0, "atirma/other") == 0);
    CHECK(it.warned("database space exceeded"));
    CHECK(trouble_listed(it).find("database space exceeded") != std::string::npos);
    it.cluster.full = false;
    CHECK(it.world.run_until([&] { return it.held_everywhere("atirma/other"); }, 10s));
    CHECK(trouble_listed(it).empty());
}

TEST_CASE("shared names: under random faults the epochs of a path only grow, and each name comes back") {
    auto seed = GENERATE(range(1, 21));
    CAPTURE(seed);
    shared_system it(3, static_cast<std::uint64_t>(seed));
    std::mt19937 dice(static_cast<unsigned>(seed));
    const std::vector<std::string> paths = {"crowd/a", "crowd/b", "crowd/c"};
    std::map<std::string, ise::sim::process*> nodes;
    for (const auto& path : paths) nodes[path] = &it.start_doubler(path.substr(6), path);
    std::map<std::string, std::uint64_t> highest;
    bool grew = true;
    auto look = [&] {
        // From the history of the store: the order in which names were granted.
        for (const auto& [key, one] : it.cluster.keys) {
            if (!key.starts_with("name/")) continue;
            auto& last = highest[key];
            grew = grew && one.created >= last;
            last = std::max(last, one.created);
        }
        return false;
    };
    for (int step = 0; step != 40; ++step) {
        auto server = dice() % it.process.size();
        auto host = fmt::format("ns{}", server);
        auto path = paths[dice() % paths.size()];
        switch (dice() % 10) {
            case 0: it.process[server] = &it.process[server]->restart(); break;
            case 1: it.cluster.cut_off.insert(host); break;
            case 2: it.cluster.cut_off.clear(); break;
            case 3: it.cluster.majority = !it.cluster.majority; break;
            case 4: it.cluster.compact(); break;
            case 5: it.cluster.answers_lost.insert(host); break;
            case 6: it.cluster.answers_lost.clear(); break;
            case 7: nodes[path] = &nodes[path]->restart(); break;
            case 8: it.cluster.latency[host] = std::chrono::milliseconds(dice() % 1000); break;
            case 9: it.cluster.full = !it.cluster.full; break;
        }
        it.world.run_until(look, std::chrono::milliseconds(dice() % 4000));
    }
    it.cluster.full = false;
    it.cluster.majority = true;
    it.cluster.cut_off.clear();
    it.cluster.answers_lost.clear();
    it.cluster.latency.clear();
    CHECK(it.world.run_until(
        [&] { return std::ranges::all_of(paths, [&](const auto& path) { return it.held_everywhere(path); }); }, 40s));
    it.world.run_for(20s);
    CHECK(grew);
    for (const auto& path : paths) {
        CHECK(it.epoch_at(0, path) == it.epoch_at(1, path));
        CHECK(it.epoch_at(1, path) == it.epoch_at(2, path));
    }
}

} // namespace shared_test
