// The instantiation server in the virtual world: processes that end, servers that crash, on a clock of its own.
#include "virtual_machine.hpp"

#include <unit/name_server/system.hpp>

#include <ise/component/component_type.hpp>
#include <ise/component/process_services.hpp>
#include <ise/instantiation/instantiation_server.hpp>
#include <ise/instantiation/services.hpp>

#include <set>

namespace server_test {

using namespace instantiation_test;
using namespace std::chrono_literals;
using ise_test::Contains;
namespace host_services = ise::instantiation::services;

namespace {

std::string describe(const std::string& type) {
    std::vector<ise::component_type> types;
    types.emplace_back(type, "for the test", "sea/" + type);
    return ise::describe_types(type + "s", "1", types);
}

std::string path_in(const std::vector<std::string>& words) {
    for (const auto& word : words)
        if (word.starts_with("--path=")) return word.substr(7);
    return {};
}

/// Runs several components in its process, of which "sea/slow" takes long to start.
class process_component final : public ise::component {
public:
    process_component(ise::node& around, ise::duration slow) : node_(around), slow_(slow) {}

private:
    ise::task<> run() override {
        provide_exclusive(ise::process_host::start,
                          [this](ise::process_host::start_request request) { return begin(path_in(request.words)); });
        provide(ise::process_host::stop, [this](ise::process_host::stop_request request) {
            if (lives_.contains(request.path)) node_.stop(request.path);
            return ise::process_host::stop_response{};
        });
        provide(ise::process_host::components, [this](ise::process_host::components_request) { return tell(); });
        co_await sleep_till(ise::time_point::max());
    }
    ise::task<ise::process_host::start_response> begin(std::string path) {
        co_await ise::this_task::ignore_cancellation;
        if (path == "sea/slow") co_await sleep(slow_);
        node_.start<names_test::doubler>(path);
        ise::process_host::start_response made;
        made.number = lives_[path] = ++last_;
        co_return made;
    }
    ise::process_host::components_response tell() const {
        ise::process_host::components_response made;
        for (const auto& one : node_.components()) {
            auto life = lives_.find(one.path);
            if (life == lives_.end()) continue;
            auto& told = made.components.emplace_back();
            told.path = one.path;
            told.number = life->second;
            told.over = one.state >= ise::component_state::stopped;
        }
        return made;
    }

    ise::node& node_;
    ise::duration slow_;
    std::map<std::string, std::uint64_t> lives_; // by path
    std::uint64_t last_ = 0;
};

/// A host "shore" with an instantiation server that may crash and come again.
class harbour {
public:
    explicit harbour(std::string policy = {})
        : system(true, 1), host(system.world, "shore"), access_policy(std::move(policy)) {
        auto& doubler = host.installed["doublers"];
        doubler.description = describe("doubler");
        doubler.run = [](ise::sim::process& env, const std::vector<std::string>& words) {
            auto made = std::make_shared<names_test::program>(env);
            made->node.start<names_test::doubler>(path_in(words));
            return made;
        };
        auto& silent = host.installed["silents"];
        silent.description = describe("silent");
        silent.run = [](ise::sim::process&, const std::vector<std::string>&) { return std::shared_ptr<void>(); };
        open();
    }

    /// Starts its server, and waits until that is registered.
    void open() {
        boot();
        REQUIRE(system.world.run_until([&] { return system.holds("ise/host/shore"); }, 30s));
    }
    /// The same without waiting.
    void boot() {
        auto begin = [this](ise::node& node) {
            server_options options;
            options.programs_folder = "/programs";
            options.state_folder = "/state";
            options.name_servers = {
                ise::endpoint::parse("tcp://" + system.world.host("ns").address() + ":7400").value()};
            options.max_starts = 10;
            ise::component_options where;
            where.listen = {ise::endpoint::parse("tcp://127.0.0.1:7500").value()};
            component = &node.start<instantiation_server>(path_of_host("shore"), where, host, options);
        };
        auto& shore = system.world.host("shore");
        std::map<std::string, std::string> variables;
        variables["ISE_NAME_SERVER"] = "tcp://" + system.world.host("ns").address() + ":7400";
        if (!access_policy.empty()) variables["ISE_ACCESS"] = "access.toml";
        shore.write_file("access.toml", access_policy);
        server = &shore.start_process(
            "instantiation",
            [begin](ise::sim::process& env) {
                auto made = std::make_shared<names_test::program>(env);
                begin(made->node);
                return made;
            },
            variables);
    }
    /// The server crashes at that operation, counted from now on; the result is true as soon as it has.
    std::shared_ptr<const bool> crash_at(int fatal) {
        auto dead = std::make_shared<bool>(false);
        host.may = [this, dead, fatal, operations = 0]() mutable {
            if (!*dead && ++operations == fatal) {
                *dead = true;
                server->crash();
            }
            return !*dead;
        };
        return dead;
    }

    /// What a client on the host gets.
    template <class Contract>
    typename Contract::response_type call(const Contract& service, typename Contract::request_type request,
                                          ise::duration deadline = 5min) {
        using response = typename Contract::response_type;
        auto outcome = std::make_shared<std::optional<ise::result<response>>>();
        system.start("shore", "client", [&](ise::node& node) {
            node.start("", [outcome, request, deadline, &service](ise::component& self) -> ise::task<> {
                auto its = self.at("ise/host/shore");
                auto copy = request;
                auto got = co_await its.try_call(service, std::move(copy), deadline);
                outcome->emplace(std::move(got));
            });
        });
        REQUIRE(system.world.run_until([&] { return outcome->has_value(); }, 1h));
        return std::move(**outcome).value();
    }
    start_response start(const std::string& path, restart_policy policy = restart_policy::never,
                         const std::string& type = "doubler") {
        start_request request;
        request.type = type;
        request.path = path;
        request.terms.policy = policy;
        return call(host_services::start, request);
    }
    instance_info state(const std::string& path) {
        for (auto& one : call(host_services::instances, instances_request{}).instances)
            if (one.path == path) return one;
        FAIL("no instance " << path);
        return {};
    }
    bool becomes(const std::string& path, instance_state wanted, ise::duration within = 2min) {
        auto until = system.world.now() + within;
        while (system.world.now() < until) {
            if (state(path).state == wanted) return true;
            system.world.run_for(100ms);
        }
        return false;
    }

    names_test::system system;
    virtual_machine host;
    ise::sim::process* server = nullptr;
    instantiation_server* component = nullptr; ///< in that process
    std::string access_policy;                 ///< of the next server; empty: none
};

} // namespace

TEST_CASE("a start completes when the component is registered and answers") {
    harbour in;
    auto result = in.start("sea/one");
    CHECK(result.outcome == start_outcome::ready);
    CHECK(result.started.state == instance_state::ready);
    CHECK(result.started.process_id == in.host.at("sea/one").stamp.pid);
    CHECK(in.system.holds("sea/one"));
    stop_request request{"sea/one", std::nullopt};
    auto ended = in.call(host_services::stop, request);
    CHECK(ended.ended.state == instance_state::stopped);
    CHECK(in.host.running().empty());
}

TEST_CASE("a component that never registers is ended at its deadline") {
    harbour in;
    auto before = in.system.world.elapsed();
    auto result = in.start("sea/one", restart_policy::always, "silent");
    CHECK(result.outcome == start_outcome::deadline);
    CHECK_THAT(result.why, Contains("it was not ready within 10 s") && Contains("does not know it yet"));
    CHECK(in.system.world.elapsed() - before >= 10s);
    CHECK(in.host.running().empty());
}

TEST_CASE("a program that is gone, and one that ends at once, are told apart") {
    harbour in;
    in.host.installed["doublers"].run = [&in](ise::sim::process& env, const std::vector<std::string>&) {
        in.system.world.after(10ms, [&env] { env.crash(); });
        return std::shared_ptr<void>();
    };
    CHECK(in.start("sea/one").outcome == start_outcome::exited);
    in.host.files["/state/sea+two.log"] = "old";
    in.host.may = [] { return false; };
    CHECK(in.start("sea/two").outcome == start_outcome::not_launched);
}

TEST_CASE("a component that ends is started again after a pause, when its name is free") {
    harbour in;
    REQUIRE(in.start("sea/one", restart_policy::on_failure).outcome == start_outcome::ready);
    auto died = in.system.world.now();
    in.host.end(in.host.at("sea/one"), {true, true, 11});
    in.system.world.run_for(10ms);
    CHECK(in.state("sea/one").state == instance_state::waiting);
    CHECK(in.state("sea/one").reason.starts_with("signal 11"));
    REQUIRE(in.becomes("sea/one", instance_state::ready));
    CHECK(in.state("sea/one").restarts == 1);
    REQUIRE(in.host.launches.size() == 2);
    CHECK(in.host.launches.back().first - died >= 250ms);
    CHECK(in.system.holds("sea/one"));
}

TEST_CASE("the name of a component that crashed is free before its lease is over, and it is ready as soon as it is "
          "started again") {
    harbour in;
    restart_terms at_once;
    at_once.policy = restart_policy::on_failure;
    at_once.first_pause = 10ms;
    start_request request;
    request.type = "doubler";
    request.path = "sea/one";
    request.terms = at_once;
    REQUIRE(in.call(host_services::start, request).outcome == start_outcome::ready);
    in.system.world.run_for(3s); // its lease was renewed, and is fresh
    auto epoch = in.system.epoch_of("sea/one");
    in.host.end(in.host.at("sea/one"), {true, true, 9});
    REQUIRE(in.system.world.run_until([&] { return in.system.epoch_of("sea/one") > epoch; }, 300ms));
    CHECK(in.becomes("sea/one", instance_state::ready, 300ms));
    CHECK(in.state("sea/one").restarts == 1);
}

TEST_CASE("what ends again and again has failed, and is not started any more") {
    harbour in;
    REQUIRE(in.start("sea/one", restart_policy::always).outcome == start_outcome::ready);
    for (int life = 0; life < 6; ++life) {
        REQUIRE(in.becomes("sea/one", instance_state::ready));
        in.host.end(in.host.at("sea/one"), {true, false, 3});
        in.system.world.run_for(10ms);
    }
    CHECK(in.becomes("sea/one", instance_state::failed));
    CHECK_THAT(in.state("sea/one").reason, Contains("exit code 3; it was started again 5 times within 60 s"));
    in.system.world.run_for(10min);
    CHECK(in.host.running().empty());
}

TEST_CASE("what does not hear is killed after the grace") {
    harbour in;
    in.host.installed["doublers"].deaf = true;
    REQUIRE(in.start("sea/one").outcome == start_outcome::ready);
    auto before = in.system.world.now();
    auto ended = in.call(host_services::stop, stop_request{"sea/one", ise::duration(3s)});
    CHECK(ended.ended.state == instance_state::stopped);
    CHECK(ended.ended.reason.starts_with("signal 9"));
    CHECK(in.system.world.now() - before >= 3s);
}

TEST_CASE("more starts than the server bears within a time are refused") {
    harbour in;
    for (int number = 0; number < 10; ++number)
        CHECK(in.start("sea/n" + std::to_string(number)).outcome == start_outcome::ready);
    auto result = in.start("sea/more");
    CHECK(result.outcome == start_outcome::too_many);
    CHECK_THAT(result.why, Contains("10 components were started within 10 s"));
    CHECK(result.retry_after > 0s);
    CHECK(result.retry_after <= 10s);
    in.system.world.run_for(result.retry_after);
    CHECK(in.start("sea/more").outcome == start_outcome::ready);
}

TEST_CASE("what is unknown is refused by every service") {
    harbour in;
    auto code = [&](auto act) {
        try {
            act();
        } catch (const ise::error& why) {
            CHECK_THAT(why.what(), Contains("no instance 'sea/none' was started here"));
            return why.code();
        }
        return ise::errc{};
    };
    CHECK(code([&] { in.call(host_services::stop, stop_request{"sea/none", std::nullopt}); }) == ise::errc::refused);
    CHECK(code([&] { in.call(host_services::kill, kill_request{"sea/none"}); }) == ise::errc::refused);
    CHECK(code([&] { in.call(host_services::restart, restart_request{"sea/none"}); }) == ise::errc::refused);
    CHECK(code([&] { in.call(host_services::last_output, output_request{"sea/none"}); }) == ise::errc::refused);
}

TEST_CASE("a start while the name server is away says so, and nothing runs") {
    harbour in;
    in.system.world.net().partition("shore", "ns");
    start_request request;
    request.type = "doubler";
    auto result = std::make_shared<std::optional<start_response>>();
    in.system.start("shore", "client", [&](ise::node& node) {
        node.start("", [result, request](ise::component& self) -> ise::task<> {
            auto server = self.at("ise/host/shore");
            auto copy = request;
            for (;;) {
                auto got = co_await server.try_call(host_services::start, copy, 1min);
                if (got) {
                    result->emplace(*got);
                    break;
                }
                co_await self.sleep(1s);
            }
        });
    });
    in.system.world.run_for(30s);
    in.system.world.net().heal("shore", "ns");
    REQUIRE(in.system.world.run_until([&] { return result->has_value(); }, 10min));
    // Whoever asked had to find the server first: both outcomes are right, none leaves anything behind.
    if ((*result)->outcome == start_outcome::ready) CHECK(in.host.running().size() == 1);
    else CHECK(in.host.running().empty());
}

TEST_CASE("an instantiation server that comes again takes over what runs") {
    harbour in;
    REQUIRE(in.start("sea/one", restart_policy::on_failure).outcome == start_outcome::ready);
    auto pid = in.host.at("sea/one").stamp.pid;
    in.server->crash();
    in.system.world.run_for(10s);
    CHECK(in.host.at("sea/one").stamp.pid == pid);
    in.open();
    auto state = in.state("sea/one");
    CHECK(state.state == instance_state::ready);
    CHECK(state.adopted);
    CHECK(state.process_id == pid);
    in.host.end(in.host.at("sea/one"), {false, false, 0});
    in.system.world.run_for(10ms);
    REQUIRE(in.becomes("sea/one", instance_state::ready));
    CHECK_FALSE(in.state("sea/one").adopted);
}

TEST_CASE("a crash of the server at any of its operations loses no process and starts none twice") {
    // Its state is written, and processes are started, in some order: it dies before each of these once.
    int crashes = 0;
    for (int fatal = 1;; ++fatal) {
        harbour in;
        auto dead = in.crash_at(fatal);
        // One comes to be, another is restarted by its policy, a third is stopped, as far as the server lives.
        auto ask = [&](auto service, auto request) {
            in.system.start("shore", "client", [&](ise::node& node) {
                node.start("", [request, service](ise::component& self) -> ise::task<> {
                    auto server = self.at("ise/host/shore");
                    auto copy = request;
                    [[maybe_unused]] auto got = co_await server.try_call(service, std::move(copy), 30s);
                });
            });
            in.system.world.run_for(5s);
        };
        for (const char* path : {"sea/one", "sea/two"}) {
            start_request request;
            request.type = "doubler";
            request.path = path;
            request.terms.policy = restart_policy::always;
            ask(host_services::start, request);
        }
        for (const auto& one : in.host.running())
            if (one->path == "sea/one" && !*dead) in.host.end(*one, {true, true, 9});
        in.system.world.run_for(10s);
        ask(host_services::stop, stop_request{"sea/two", std::nullopt});
        if (!*dead) break; // it has outlived all of it
        ++crashes;
        in.host.may = [] { return true; };
        in.open();
        in.system.world.run_for(60s);
        INFO("it died at operation " << fatal);
        auto known = in.call(host_services::instances, instances_request{}).instances;
        std::size_t running = 0;
        for (const auto& one : known) {
            CHECK((one.state == instance_state::ready || one.state == instance_state::stopped ||
                   one.state == instance_state::failed));
            if (one.process_id != 0) ++running;
        }
        CHECK(in.host.running().size() == running);
        for (const char* path : {"sea/one", "sea/two"})
            CHECK(std::ranges::count_if(in.host.running(), [&](const auto& one) { return one->path == path; }) <= 1);
    }
    CHECK(crashes > 10);
}

TEST_CASE("a crash of the server at any operation of a takeover loses no instance") {
    int crashes = 0;
    for (int fatal = 1;; ++fatal) {
        harbour in;
        const auto paths = {"sea/one", "sea/two", "sea/three"};
        for (const char* path : paths) REQUIRE(in.start(path, restart_policy::always).outcome == start_outcome::ready);
        in.server->crash();
        in.host.end(in.host.at("sea/three"), {true, true, 9}); // its next life is part of the takeover
        auto dead = in.crash_at(fatal);
        in.boot();
        in.system.world.run_for(30s);
        if (!*dead) break;
        ++crashes;
        in.host.may = [] { return true; };
        in.open();
        INFO("it died at operation " << fatal);
        for (const char* path : paths) CHECK(in.becomes(path, instance_state::ready));
        CHECK(in.host.running().size() == 3);
    }
    CHECK(crashes > 2);
}

TEST_CASE("a server that has not taken over yet answers no request, and leaves the state alone") {
    harbour in;
    REQUIRE(in.start("sea/one").outcome == start_outcome::ready);
    CHECK(in.component->has_taken_over());
    in.server->crash();
    const auto state = in.host.files.at("/state/state.json");
    in.host.installed["silents"].describes_after = 4s;
    in.boot();
    auto answer = std::make_shared<std::optional<ise::errc>>();
    in.system.start("shore", "client", [answer](ise::node& node) {
        node.start("", [answer](ise::component& self) -> ise::task<> { // it knows the endpoint from before
            auto server = self.at(ise::endpoint::parse("tcp://127.0.0.1:7500").value());
            start_request request;
            request.type = "doubler";
            request.path = "sea/one";
            auto got = co_await server.try_call(host_services::start, std::move(request), 1s);
            *answer = got ? ise::errc{} : got.error().code();
        });
    });
    in.system.world.run_for(2s);
    CHECK_FALSE(in.component->has_taken_over());
    CHECK(*answer == ise::errc::no_such_service);
    CHECK(in.host.files.at("/state/state.json") == state);
    REQUIRE(in.system.world.run_until([&] { return in.component->has_taken_over(); }, 10s));
    REQUIRE(in.becomes("sea/one", instance_state::ready));
    CHECK(in.host.launches.size() == 1);
}

TEST_CASE("a program that does not describe itself in time at a takeover is asked again") {
    harbour in;
    restart_terms hasty; // no time for a description
    hasty.policy = restart_policy::on_failure;
    hasty.first_pause = 10ms;
    hasty.max_pause = 10ms;
    hasty.ready_within = 1s;
    for (const char* path : {"sea/one", "sea/two"}) {
        start_request request;
        request.type = "doubler";
        request.path = path;
        request.terms = hasty;
        REQUIRE(in.call(host_services::start, request).outcome == start_outcome::ready);
    }
    in.server->crash();
    in.host.installed["doublers"].describes_after = 6s;
    in.open();
    CHECK(in.state("sea/two").program.empty());
    in.host.end(in.host.at("sea/one"), {true, true, 9});
    in.system.world.run_for(10s);
    CHECK(in.state("sea/one").state == instance_state::starting);
    in.host.installed["doublers"].describes_after = {};
    CHECK(in.becomes("sea/one", instance_state::ready));
    CHECK(in.state("sea/one").restarts == 1);
    CHECK(in.state("sea/two").program == "doublers"); // its probe is back
    CHECK(in.state("sea/two").state == instance_state::ready);
}

TEST_CASE("what was taken over and is installed no more fails at its restart") {
    harbour in;
    REQUIRE(in.start("sea/one", restart_policy::on_failure).outcome == start_outcome::ready);
    in.server->crash();
    in.host.installed["doublers"].description = describe("tripler");
    in.open();
    in.host.end(in.host.at("sea/one"), {true, true, 9});
    CHECK(in.becomes("sea/one", instance_state::failed));
    CHECK_THAT(in.state("sea/one").reason, Contains("no program here has the type 'doubler' any more"));
}

TEST_CASE("the name of a deployment is a name, so that no start fills the state") {
    harbour in;
    start_request request;
    request.type = "doubler";
    request.path = "sea/one";
    for (const auto& name : {std::string(std::size_t{17} << 20, 'a'), std::string(1000, '\x01'), std::string("a b")}) {
        request.deployment = name;
        auto result = in.call(host_services::start, request);
        CHECK(result.outcome == start_outcome::bad_argument);
        CHECK_THAT(result.why, Contains("is not the name of a deployment"));
    }
    request.deployment = std::string(200, 'a');
    CHECK(in.call(host_services::start, request).outcome == start_outcome::ready);
}

TEST_CASE("a start that would make the state larger than one that can be read is refused") {
    harbour in;
    ise::component_type listed("listed", "for the test", "sea/listed");
    auto marks = std::make_shared<std::vector<std::string>>();
    listed.parameters.add("mark", *marks, "any");
    std::vector<ise::component_type> types;
    types.push_back(std::move(listed));
    auto& program = in.host.installed["listeds"];
    program = in.host.installed["doublers"];
    program.description = ise::describe_types("listeds", "1", types);
    start_request request;
    request.type = "listed";
    request.arguments.assign(256, {"mark", std::string(4096, '"')}); // 2 MiB as JSON
    std::size_t ready = 0;
    start_response result;
    for (; ready < 9; ++ready) {
        request.path = "sea/n" + std::to_string(ready);
        result = in.call(host_services::start, request);
        if (result.outcome != start_outcome::ready) break;
        in.system.world.run_for(10s);
    }
    CHECK(ready == 5);
    CHECK(result.outcome == start_outcome::too_many);
    CHECK_THAT(result.why, Contains("max_accepted_bytes"));
    CHECK(result.retry_after == 0s);
    in.server->crash();
    in.open();
    CHECK(in.call(host_services::instances, instances_request{}).instances.size() == ready);
}

TEST_CASE("a state that cannot be read is set aside, whatever its size") {
    for (const auto& content : {std::string(std::size_t{17} << 20, '['), std::string("not JSON")}) {
        harbour in;
        in.server->crash();
        in.host.files["/state/state.json"] = content;
        in.system.world.run_for(10s);
        in.open();
        CHECK((in.host.files["/state/state.json.unreadable"] == content)); // too large to be printed
        CHECK(in.start("sea/one").outcome == start_outcome::ready);
        CHECK((in.host.files["/state/state.json.unreadable"] == content)); // too large to be printed
        CHECK(in.host.files["/state/state.json"].size() < 10'000);
    }
}

TEST_CASE("a server that cannot read its state leaves that alone, and does not run") {
    harbour in;
    REQUIRE(in.start("sea/one").outcome == start_outcome::ready);
    in.server->crash();
    in.host.reads = false;
    in.boot();
    in.system.world.run_for(30s);
    CHECK_FALSE(in.system.holds("ise/host/shore"));
    in.server->crash();
    in.host.reads = true;
    in.open();
    CHECK(in.state("sea/one").adopted);
}

TEST_CASE("a start in a shared process that takes too long ends nobody else there, and leaves nothing behind") {
    for (auto slow : {3s, 30s}) { // within the least time that it has, and beyond
        INFO("slow " << slow.count());
        harbour in;
        auto& sharer = in.host.installed["sharers"];
        std::vector<ise::component_type> types;
        types.emplace_back("sharer", "for the test", "sea/sharer");
        sharer.description = ise::describe_types("sharers", "1", types, true);
        sharer.run = [slow](ise::sim::process& env, const std::vector<std::string>& words) {
            auto made = std::make_shared<names_test::program>(env);
            ise::component_options control;
            control.listen = {ise::endpoint::parse(words.at(1).substr(std::string("--control=").size())).value()};
            control.registers = false;
            made->node.start<process_component>("", control, made->node, slow);
            return made;
        };
        start_request request;
        request.type = "sharer";
        request.process = "main";
        request.path = "sea/one";
        REQUIRE(in.call(host_services::start, request).outcome == start_outcome::ready);
        request.path = "sea/slow";
        request.terms.ready_within = 100ms;
        CHECK(in.call(host_services::start, request).outcome == start_outcome::not_launched);
        in.system.world.run_for(1min);
        CHECK(in.host.launches.size() == 1); // the process
        CHECK(in.state("sea/one").state == instance_state::ready);
        CHECK(in.state("sea/slow").state == instance_state::failed);
        CHECK_FALSE(in.system.holds("sea/slow"));
    }
}

TEST_CASE("state and output of a component are for those who may read that component") {
    harbour in(R"(version = 1
[[allow]]
who = "nobody"
name = "**"
read = "**"
host = [{ host = "shore", do = ["start", "stop"] }]
[[deny]]
who = "nobody"
read = "sea/secret"
)");
    struct heard {
        std::set<std::string> events, output;
    };
    auto got = std::make_shared<heard>();
    in.system.start("shore", "watcher", [got](ise::node& node) {
        node.start("", [got](ise::component& self) -> ise::task<> {
            auto events = co_await self.at("ise/host/shore").subscribe(host_services::events);
            for (;;) {
                auto event = co_await events.next();
                if (!event) break;
                got->events.insert(event->instance.path);
            }
        });
    });
    in.system.world.run_for(1s);
    CHECK(in.start("sea/open").outcome == start_outcome::ready);
    CHECK(in.start("sea/secret").outcome == start_outcome::ready);
    in.system.world.run_for(1s);
    CHECK(got->events == std::set<std::string>{"sea/open"});
    auto listed = in.call(host_services::instances, instances_request{}).instances;
    REQUIRE(listed.size() == 1);
    CHECK(listed.front().path == "sea/open");
    auto code = [&](const std::string& path) {
        try {
            in.call(host_services::last_output, output_request{path});
        } catch (const ise::error& why) {
            return why.code();
        }
        return ise::errc{};
    };
    CHECK(code("sea/open") == ise::errc{});
    CHECK(code("sea/secret") == ise::errc::access_denied);
    for (const std::string path : {"sea/open", "sea/secret"})
        in.system.start("shore", "follower", [got, path](ise::node& node) {
            node.start("", [got, path](ise::component& self) -> ise::task<> {
                follow_request request{path};
                ise::subscribe_options terms;
                auto output = co_await self.at("ise/host/shore").subscribe(host_services::output, request, terms);
                for (;;) {
                    auto piece = co_await output.next();
                    if (!piece) break;
                    got->output.insert(piece->path);
                }
            });
        });
    in.system.world.run_for(1s);
    for (const char* file : {"/state/sea+open.log", "/state/sea+secret.log"}) in.host.files[file] += "a line\n";
    in.system.world.run_for(2s);
    CHECK(got->output == std::set<std::string>{"sea/open"});
}

} // namespace server_test
