// A node with many names, and a name server that keeps a book of what it is asked.
#include <ise/component/node.hpp>
#include <ise/naming/lease_registrar.hpp>
#include <ise/naming/services.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>
#include <support/party.hpp>

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace registrar_test {

using namespace std::chrono_literals;
namespace naming = ise::naming;

namespace {

struct book {
    struct entry {
        ise::time_point at;
        naming::component_claim claim;
    };
    std::vector<entry> claims;
    std::vector<std::size_t> batches;
    std::vector<std::string> departures;
    std::vector<ise::time_point> renewals;        // by any request that renews the lease
    std::map<std::string, ise::duration> not_yet; // asks for one again that much later, once
    std::uint64_t lease_number = 0;
    bool known = false;

    std::vector<std::string> claimed() const {
        std::vector<std::string> paths;
        for (const auto& one : claims) paths.push_back(one.claim.path);
        return paths;
    }
    ise::duration longest_gap() const {
        ise::duration longest{};
        for (std::size_t i = 1; i < renewals.size(); ++i) longest = std::max(longest, renewals[i] - renewals[i - 1]);
        return longest;
    }
};

constexpr ise::duration lease = 2s;

class bookkeeper final : public ise::component {
public:
    explicit bookkeeper(book& keeps) : book_(keeps) {}

private:
    ise::task<> run() override {
        provide(naming::enroll, [this](naming::register_request request) {
            if (!std::exchange(book_.known, true)) ++book_.lease_number;
            book_.renewals.push_back(now());
            book_.batches.push_back(request.components.size());
            naming::register_response response;
            response.server_incarnation = 1;
            response.lease = lease;
            response.lease_number = book_.lease_number;
            for (auto& claim : request.components) {
                naming::grant made;
                made.path = claim.path;
                if (auto later = book_.not_yet.extract(claim.path)) {
                    made.what = naming::verdict::wait;
                    made.retry_after = later.mapped();
                } else {
                    made.epoch = claim.epoch != 0 ? claim.epoch : ++epoch_;
                    made.proof = made.epoch + 7;
                }
                response.grants.push_back(std::move(made));
                book_.claims.push_back({now(), std::move(claim)});
            }
            return response;
        });
        provide(naming::renew, [this](naming::renew_request) {
            naming::renew_response response;
            response.known = book_.known;
            response.server_incarnation = 1;
            response.lease = lease;
            response.lease_number = book_.lease_number;
            if (book_.known) book_.renewals.push_back(now());
            return response;
        });
        provide(naming::withdraw, [this](naming::withdraw_request request) {
            for (const auto& gone : request.departures) book_.departures.push_back(gone.path);
            return naming::withdraw_response();
        });
        co_return;
    }

    book& book_;
    std::uint64_t epoch_ = 0;
};

struct program {
    program(ise::environment& env, ise::node_options options) : node(env, std::move(options)) {}
    ise::node node;
};

ise::node_options quiet() {
    ise::node_options made;
    made.log = ise::log_sink([](const ise::log_record&) {});
    return made;
}

class system {
public:
    explicit system(std::vector<std::string> names) : names_(std::move(names)) {
        world.host("ns").start_process("names", [this](ise::sim::process& env) {
            auto options = quiet();
            options.use_names = false;
            auto made = std::make_shared<program>(env, std::move(options));
            ise::component_options where;
            where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7400").value()};
            where.registers = false;
            made->node.start<bookkeeper>(std::string(naming::server_path), where, kept);
            return made;
        });
    }

    /// Starts all, on one loop.
    void start() {
        auto run = [this](ise::sim::process& env) {
            auto made = std::make_shared<program>(env, quiet());
            node = &made->node;
            for (const auto& name : names_) {
                ise::component_options how;
                how.listen = {ise::endpoint::parse("inproc://" + name).value()};
                if (name != names_.front()) how.together_with = names_.front();
                node->start(
                    name, [](ise::component& self) -> ise::task<> { co_await self.sleep(24h); }, std::move(how));
            }
            return made;
        };
        world.host("boat").start_process("crowd", run,
                                         {{"ISE_NAME_SERVER", "tcp://" + world.host("ns").address() + ":7400"}});
    }
    bool granted_all(ise::duration within) {
        return world.run_until([&] { return kept.claims.size() >= names_.size(); }, within);
    }
    ise::sim::link& link() { return world.net().between("boat", "ns"); }

    book kept; // outlives the world
    ise::sim::world world;
    ise::node* node = nullptr;

private:
    std::vector<std::string> names_;
};

// In another order than that of the paths.
std::vector<std::string> shuffled(std::size_t count) {
    std::vector<std::string> names;
    for (std::size_t i = 0; i != count; ++i) names.push_back("crowd/" + std::to_string(i * 7919 % count));
    return names;
}

std::set<std::string> set_of(const std::vector<std::string>& names) { return {names.begin(), names.end()}; }

} // namespace

TEST_CASE("registrar: of many names the server hears of each once, in the order in which they came") {
    const auto names = shuffled(1000);
    registrar_test::system it(names);
    it.start();
    it.world.run_for(30s);
    CHECK(it.kept.claimed() == names);
    CHECK(*std::ranges::max_element(it.kept.batches) > 1);
    CHECK(it.kept.longest_gap() < lease);
}

TEST_CASE("registrar: a server that has forgotten everything hears of each name once more, with what it was granted") {
    const auto names = shuffled(1000);
    registrar_test::system it(names);
    it.start();
    REQUIRE(it.granted_all(30s));
    it.world.run_for(5s);
    it.kept.known = false;
    it.kept.claims.clear();
    it.world.run_for(5s);
    auto claimed = it.kept.claimed();
    CHECK(claimed.size() == names.size());
    CHECK(set_of(claimed) == set_of(names));
    CHECK(std::ranges::all_of(it.kept.claims, [](const auto& one) {
        return one.claim.epoch != 0 && one.claim.proof == one.claim.epoch + 7;
    }));
}

TEST_CASE("registrar: a name that has to wait is asked for again when it may be, and delays no other") {
    const auto names = shuffled(600);
    registrar_test::system it(names);
    it.kept.not_yet = {{names[1], 700ms}, {names[2], 300ms}};
    it.start();
    it.world.run_for(10s);
    auto times_of = [&](const std::string& path) {
        std::vector<ise::time_point> times;
        for (const auto& one : it.kept.claims)
            if (one.claim.path == path) times.push_back(one.at);
        return times;
    };
    CHECK(it.kept.claims.size() == names.size() + 2);
    for (auto [path, wait] : {std::pair(names[1], 700ms), std::pair(names[2], 300ms)}) {
        auto times = times_of(path);
        REQUIRE(times.size() == 2);
        CHECK(times[1] - times[0] >= wait);
        CHECK(times[1] - times[0] < wait + 50ms);
    }
    for (std::size_t i = 3; i != names.size(); ++i) CHECK(times_of(names[i]).at(0) < times_of(names[2]).at(1));
}

TEST_CASE("registrar: a change while a claim is on its way is told too") {
    registrar_test::system it({"crowd/a", "crowd/b"});
    it.link().latency = 100ms;
    it.start();
    REQUIRE(it.world.run_until([&] { return !it.kept.claims.empty(); }, 10s)); // the answer is on its way
    auto before = it.kept.claims.size();
    auto& changes = it.node->start("crowd/c", [](ise::component& self) -> ise::task<> {
        self.serve_role("crowd/lead");
        co_await self.sleep(24h);
    });
    it.world.run_for(50ms);
    changes.serve_role("crowd/second");
    it.world.run_for(5s);
    REQUIRE(it.kept.claims.size() > before);
    CHECK(it.kept.claims.back().claim.path == "crowd/c");
    CHECK(it.kept.claims.back().claim.roles.size() == 2);
}

TEST_CASE("registrar: while many names leave, the lease of those that stay is renewed") {
    const auto names = shuffled(4000);
    registrar_test::system it(names);
    it.link().latency = 100ms;
    it.start();
    REQUIRE(it.granted_all(60s));
    it.world.run_for(5s);
    it.kept.renewals = {it.kept.renewals.back()};
    for (std::size_t i = 1; i != names.size(); ++i) it.node->stop(names[i]);
    REQUIRE(it.world.run_until([&] { return it.kept.departures.size() >= names.size() - 1; }, 60s));
    it.world.run_for(5s);
    CHECK(it.kept.longest_gap() < lease);
    CHECK(it.kept.departures.size() == names.size() - 1); // each once
    CHECK(set_of(it.kept.departures) == set_of({names.begin() + 1, names.end()}));
}

TEST_CASE(
    "registrar: many names are registered over a slow link, on which a full request lasts longer than the lease") {
    const auto names = shuffled(1000);
    registrar_test::system it(names);
    it.link().bandwidth_bytes_per_second = 20'000;
    it.start();
    REQUIRE(it.world.run_until([&] { return set_of(it.kept.claimed()).size() == names.size(); }, 5min));
    it.kept.renewals = {it.kept.renewals.back()};
    it.world.run_for(20s);
    CHECK(it.kept.longest_gap() < lease);
}

TEST_CASE("registrar: what is left of a component's former life changes nothing of the name of its present one") {
    registrar_test::system it({});
    auto& process = it.world.host("boat").start_process("boat");
    ise_test::party boat(process, process.make_loop("main"), "boat");
    ise::lease_registrar names(*boat.services, {ise::endpoint::parse("tcp://ns:7400").value()}, lease);
    ise::registration made;
    made.path = "boat";
    made.state = "ready";
    for (auto life : {1u, 2u}) {
        made.incarnation = life;
        ise_test::start(boat.on, names.enroll(made, 1min));
        REQUIRE(it.world.run_until([&] { return it.kept.claims.size() == life; }, 10s));
    }
    names.set_state("boat", 1, "stalled");
    ise_test::start(boat.on, names.withdraw("boat", 1));
    it.world.run_for(10s);
    CHECK(it.kept.departures.empty());
    CHECK(it.kept.claims.size() == 2);
    names.set_state("boat", 2, "stalled");
    REQUIRE(it.world.run_until([&] { return it.kept.claims.size() == 3; }, 10s));
    CHECK(it.kept.claims.back().claim.state == "stalled");
    ise_test::start(boat.on, names.withdraw("boat", 2));
    CHECK(it.world.run_until([&] { return !it.kept.departures.empty(); }, 10s));
    boat.services->stop(100ms);
    boat.scope.stop();
    REQUIRE(it.world.run_until([&] { return boat.scope.size() == 0; }, 10s));
}

TEST_CASE("registrar: a name that is granted after the wait for it was cancelled is told of all the same") {
    registrar_test::system it({});
    it.kept.not_yet["boat"] = 3s;
    auto& process = it.world.host("boat").start_process("boat");
    ise_test::party boat(process, process.make_loop("main"), "boat");
    ise::lease_registrar names(*boat.services, {ise::endpoint::parse("tcp://ns:7400").value()}, lease);
    std::vector<std::uint64_t> told;
    names.on_change = [&](const auto&, ise::result<std::uint64_t> epoch) { told.push_back(epoch.value()); };
    ise::registration made;
    made.path = "boat";
    made.incarnation = 1;
    auto enrolling = ise_test::start(boat.on, names.enroll(made, 1min));
    REQUIRE(it.world.run_until([&] { return it.kept.claims.size() == 1; }, 10s));
    it.world.run_for(100ms);
    enrolling->cancel.emit(asio::cancellation_type::terminal);
    it.world.run_for(100ms);
    CHECK(enrolling->code() == ise::errc::cancelled);
    it.world.run_until([&] { return !told.empty(); }, 10s);
    CHECK(told == std::vector<std::uint64_t>{1});
    boat.services->stop(100ms);
    boat.scope.stop();
    REQUIRE(it.world.run_until([&] { return boat.scope.size() == 0; }, 10s));
}

} // namespace registrar_test
