// Instances that are changed while they run, in the virtual world.
#include "virtual_machine.hpp"

#include <unit/name_server/system.hpp>

#include <ise/component/component_type.hpp>
#include <ise/instantiation/instantiation_server.hpp>
#include <ise/instantiation/services.hpp>

#include <pwd.h>
#include <unistd.h>

namespace changing_test {

using namespace instantiation_test;
using namespace std::chrono_literals;
using ise_test::Contains;
namespace host_services = ise::instantiation::services;

namespace {

struct wind_options {
    double speed = 6;
    std::string course = "T1";
};

class wind final : public ise::component {
public:
    explicit wind(wind_options options) : options_(std::move(options)) { announce_when_ready(); }

    void change(const wind_options& now) {
        if (now.speed > 30) throw ise::error(ise::errc::refused, "no gales");
        options_ = now;
    }

private:
    ise::task<> run() override {
        if (options_.course != "reef") co_await ready(); // else it never is
    }

    wind_options options_;
};

ise::component_type wind_type(const std::shared_ptr<wind_options>& options) {
    ise::component_type type("wind", "blows", "sea/wind");
    type.parameters.add("speed", options->speed, "how hard").range(0, 40).changeable();
    type.parameters.add("course", options->course, "what it sails");
    type.reads("WIND_PASSWORD").reads("WIND_USER");
    type.makes<wind>(options);
    return type;
}

/// A host "shore" whose program has the type "wind".
class harbour {
public:
    explicit harbour(launch_rules first = launch_rules())
        : system(true, 1), host(system.world, "shore"), rules(std::move(first)) {
        auto& program = host.installed["winds"];
        std::vector<ise::component_type> types;
        types.push_back(wind_type(std::make_shared<wind_options>()));
        program.description = ise::describe_types("winds", "1", types);
        program.run = [this](ise::sim::process& env, const std::vector<std::string>& words) {
            auto type = wind_type(std::make_shared<wind_options>());
            std::string path;
            last_words = words;
            for (const auto& word : words) {
                auto equals = word.find('=');
                if (equals == word.npos) continue;
                if (word.starts_with("--path=")) path = word.substr(equals + 1);
                else if (type.parameters.find(word.substr(2, equals - 2)))
                    type.parameters.set(word.substr(2, equals - 2), word.substr(equals + 1)).value();
            }
            auto made = std::make_shared<names_test::program>(env);
            ise::component_options how;
            how.parameters = type.live();
            made->node.launch(path, type.make(), std::move(how));
            return made;
        };
        open();
    }
    void open() {
        server = &system.start("shore", "instantiation", [this](ise::node& node) {
            server_options options;
            options.programs_folder = "/programs";
            options.state_folder = "/state";
            options.rules = rules;
            options.name_servers = {
                ise::endpoint::parse("tcp://" + system.world.host("ns").address() + ":7400").value()};
            node.start<instantiation_server>(path_of_host("shore"), ise::component_options(), host, options);
        });
        REQUIRE(system.world.run_until([&] { return system.holds("ise/host/shore"); }, 30s));
    }

    template <class Contract>
    using outcome = std::shared_ptr<std::optional<ise::result<typename Contract::response_type>>>;

    template <class Contract>
    outcome<Contract> ask(const Contract& service, typename Contract::request_type request) {
        auto answer = std::make_shared<std::optional<ise::result<typename Contract::response_type>>>();
        system.start("shore", "client", [&](ise::node& node) {
            node.start("", [answer, request, &service](ise::component& self) -> ise::task<> {
                auto its = self.at("ise/host/shore");
                auto copy = request;
                auto got = co_await its.try_call(service, std::move(copy), 5min);
                answer->emplace(std::move(got));
            });
        });
        return answer;
    }
    template <class Contract>
    ise::result<typename Contract::response_type> call(const Contract& service,
                                                       typename Contract::request_type request) {
        auto asked = ask(service, std::move(request));
        REQUIRE(system.world.run_until([&] { return asked->has_value(); }, 1h));
        return std::move(**asked);
    }
    static start_request wanted(std::vector<argument> arguments = {}) {
        start_request made;
        made.type = "wind";
        made.arguments = std::move(arguments);
        made.terms.policy = restart_policy::always;
        made.deployment = "sea";
        return made;
    }
    static start_request secretive(const std::string& password) {
        auto made = wanted({{"speed", "8"}});
        made.variables = {{"WIND_USER", "gando"}, {"WIND_PASSWORD", password}};
        return made;
    }
    checked_start check(start_request what) {
        checks_request request;
        request.wanted.push_back(std::move(what));
        return call(host_services::check, std::move(request)).value().checked.at(0);
    }
    void start() {
        REQUIRE(call(host_services::start, wanted({{"speed", "8"}})).value().outcome == start_outcome::ready);
    }
    ise::result<change_response> change(start_request to) {
        change_request request;
        request.to = std::move(to);
        return call(host_services::change, std::move(request));
    }
    ise::result<set_response> set(const std::string& name, const std::string& value) {
        set_request request;
        request.path = "sea/wind";
        request.settings.push_back({name, value});
        return call(host_services::set, std::move(request));
    }
    std::vector<instance_info> instances() {
        return call(host_services::instances, instances_request{}).value().instances;
    }
    int pid() { return host.at("sea/wind").stamp.pid; }
    bool has_word(const std::string& word) const { return std::ranges::find(last_words, word) != last_words.end(); }
    /// Its process ends, and the next one is ready.
    void next_life() {
        auto before = host.launches.size();
        host.end(host.at("sea/wind"), {true, true, 9});
        REQUIRE(system.world.run_until([&] { return host.launches.size() > before && !host.running().empty(); }, 1min));
    }

    names_test::system system;
    virtual_machine host;
    ise::sim::process* server = nullptr;
    launch_rules rules; ///< of the next one
    std::vector<std::string> last_words;
};

} // namespace

TEST_CASE("a change in place keeps the process, and holds in the next life of it and of the server") {
    harbour in;
    in.start();
    int before = in.pid();
    auto result = in.change(in.wanted({{"speed", "12"}})).value();
    CHECK(result.way == change_way::in_place);
    CHECK(result.outcome.outcome == start_outcome::ready);
    CHECK(result.outcome.started.arguments.front().value == "12");
    CHECK(result.former.arguments.front().value == "8");
    CHECK(in.pid() == before);
    CHECK(in.change(in.wanted({{"speed", "12.0"}})).value().way == change_way::nothing);
    in.server->crash();
    in.open();
    CHECK(in.instances().front().arguments.front().value == "12");
    CHECK(in.instances().front().deployment == "sea");
    in.next_life();
    CHECK(in.has_word("--speed=12"));
}

TEST_CASE("other terms of restart are taken over in place") {
    harbour in;
    in.start();
    int before = in.pid();
    auto to = in.wanted({{"speed", "8"}});
    to.terms.policy = restart_policy::never;
    CHECK(in.change(to).value().way == change_way::in_place);
    CHECK(in.pid() == before);
    in.host.end(in.host.at("sea/wind"), {true, true, 9});
    in.system.world.run_for(2min);
    CHECK(in.instances().front().state == instance_state::failed);
}

TEST_CASE("what cannot be changed in place starts it again, and where that fails it runs as before") {
    harbour in;
    in.start();
    int before = in.pid();
    auto result = in.change(in.wanted({{"speed", "8"}, {"course", "T2"}})).value();
    CHECK(result.way == change_way::restarted);
    CHECK(in.pid() != before);
    CHECK(in.has_word("--course=T2"));
    auto wrecked = in.change(in.wanted({{"course", "reef"}})).value();
    CHECK(wrecked.outcome.outcome == start_outcome::deadline);
    CHECK_THAT(wrecked.outcome.why, Contains("it was not ready within 10 s") && Contains("it runs again as before"));
    CHECK(wrecked.outcome.started.state == instance_state::ready);
    CHECK(in.has_word("--course=T2"));
    CHECK(in.instances().front().arguments.back().value == "T2");
}

TEST_CASE("one that has ended is started by a change") {
    harbour in;
    in.start();
    stop_request request;
    request.path = "sea/wind";
    CHECK(in.call(host_services::stop, request).value().ended.state == instance_state::stopped);
    auto result = in.change(in.wanted({{"speed", "12"}})).value();
    CHECK(result.way == change_way::restarted);
    CHECK(result.outcome.outcome == start_outcome::ready);
    CHECK(in.has_word("--speed=12"));
}

TEST_CASE("what the component has against a change, and what cannot be, is told") {
    harbour in;
    in.start();
    auto vetoed = in.change(in.wanted({{"speed", "35"}}));
    REQUIRE(!vetoed);
    CHECK(vetoed.error().code() == ise::errc::refused);
    CHECK_THAT(vetoed.error().message(), Contains("sea/wind refuses it: no gales"));
    CHECK(in.change(in.wanted({{"speed", "41"}})).value().outcome.outcome == start_outcome::bad_argument);
    auto nobody = in.wanted();
    nobody.path = "sea/nobody";
    CHECK(in.change(nobody).error().code() == ise::errc::refused);
    CHECK(in.instances().front().arguments.front().value == "8");
}

TEST_CASE("setting a parameter changes nothing else, and never starts it again") {
    harbour in;
    in.start();
    int before = in.pid();
    CHECK(in.set("speed", "9").value().instance.arguments.front().value == "9");
    auto fixed = in.set("course", "T2");
    REQUIRE(!fixed);
    CHECK(fixed.error().code() == ise::errc::refused);
    CHECK_THAT(fixed.error().message(),
               Contains("parameter 'course' of 'sea/wind' cannot be changed while it runs, only speed"));
    CHECK(in.pid() == before);
    stop_request request;
    request.path = "sea/wind";
    CHECK(in.call(host_services::stop, request));
    auto over = in.set("speed", "10");
    REQUIRE(!over);
    CHECK_THAT(over.error().message(), Contains("'sea/wind' does not run"));
}

TEST_CASE("a parameter that is set and not on the disk is an error, until it is") {
    harbour in;
    in.start();
    in.host.may = [] { return false; };
    for (int attempt = 0; attempt != 2; ++attempt) {
        auto lost = in.set("speed", "9");
        REQUIRE(!lost);
        CHECK(lost.error().code() == ise::errc::refused);
        CHECK_THAT(lost.error().message(), Contains("'sea/wind' has the new value") && Contains("not on disk: dead"));
    }
    in.host.may = [] { return true; };
    CHECK(in.set("speed", "9"));
    in.server->crash();
    in.open();
    CHECK(in.instances().front().arguments.front().value == "9");
}

TEST_CASE("of two changes at once one is refused") {
    harbour in;
    in.start();
    change_request one, other;
    one.to = in.wanted({{"course", "T2"}});
    other.to = in.wanted({{"course", "T3"}});
    auto first = in.ask(host_services::change, one);
    auto second = in.ask(host_services::change, other);
    REQUIRE(in.system.world.run_until([&] { return first->has_value() && second->has_value(); }, 1h));
    CHECK((*first)->has_value() != (*second)->has_value());
    const auto& refused = (*first)->has_value() ? **second : **first;
    CHECK_THAT(refused.error().message(), Contains("is being changed already"));
}

TEST_CASE("what is forgotten leaves nothing") {
    harbour in;
    in.start();
    in.host.files["/state/sea+wind.log"] = "hello";
    stop_request request;
    request.path = "sea/wind";
    request.forget = true;
    CHECK(in.call(host_services::stop, request).value().ended.state == instance_state::stopped);
    CHECK(in.instances().empty());
    CHECK_FALSE(in.host.files.contains("/state/sea+wind.log"));
    CHECK_THAT(in.host.files.at("/state/state.json"), !Contains("sea/wind"));
}

TEST_CASE("secrets do not leave the instantiation server") {
    harbour in;
    REQUIRE(in.call(host_services::start, in.secretive("hunter2")).value().outcome == start_outcome::ready);
    auto result = in.instances().front();
    REQUIRE(result.variables.size() == 2);
    CHECK(result.variables[0].name == "WIND_USER");
    // Not a mark either: who guesses would know when he is right.
    for (const auto& one : result.variables) CHECK(one.value.empty());
    auto changed = in.change(in.secretive("hunter3")).value();
    CHECK(changed.way == change_way::restarted);
    for (const auto& one : changed.former.variables) CHECK(one.value.empty());
    for (const auto& one : changed.outcome.started.variables) CHECK(one.value.empty());
}

TEST_CASE("a change of secrets is undone by who does not know them") {
    harbour in;
    REQUIRE(in.call(host_services::start, in.secretive("hunter2")).value().outcome == start_outcome::ready);
    auto changed = in.change(in.secretive("hunter3")).value();
    REQUIRE(changed.undo != 0);
    in.server->crash();
    in.open(); // also after that
    change_request back;
    back.to = changed.former;
    back.to.path = "sea/wind";
    back.undo = changed.undo;
    CHECK(in.call(host_services::change, back).value().way == change_way::restarted);
    CHECK_FALSE(in.check(in.secretive("hunter2")).other_environment);
    CHECK(in.check(in.secretive("hunter3")).other_environment);
    auto again = in.call(host_services::change, back);
    REQUIRE(!again);
    CHECK_THAT(again.error().message(), Contains("'sea/wind' cannot be undone: it was changed again since"));
}

TEST_CASE("secrets cannot be guessed quickly by comparing") {
    harbour in;
    REQUIRE(in.call(host_services::start, in.secretive("hunter2")).value().outcome == start_outcome::ready);
    auto last = checked_start();
    for (int guess = 0; guess < 21; ++guess) last = in.check(in.secretive("guess"));
    CHECK(last.outcome == start_outcome::too_many);
    CHECK_THAT(last.why, Contains("environment variables of 'sea/wind' were compared 20 times within 10 s"));
    in.system.world.run_for(11s);
    CHECK(in.check(in.secretive("hunter2")).outcome == start_outcome::ready);
}

TEST_CASE("a program that was rebuilt is told, and a change runs it") {
    harbour in;
    in.start();
    CHECK_FALSE(in.instances().front().rebuilt);
    int before = in.pid();
    in.host.installed["winds"].version = "2";
    CHECK(in.instances().front().rebuilt);
    CHECK(in.set("speed", "9")); // no reason to end what runs
    CHECK(in.pid() == before);
    in.server->crash();
    in.open();
    CHECK(in.instances().front().rebuilt);
    CHECK(in.change(in.wanted({{"speed", "9"}})).value().way == change_way::restarted);
    CHECK(in.pid() != before);
    CHECK_FALSE(in.instances().front().rebuilt);
    in.host.installed["winds"].version = "3";
    in.next_life();
    CHECK_FALSE(in.instances().front().rebuilt); // what was started again is the new one
}

TEST_CASE("what is against a start is told before anything is started") {
    harbour in;
    CHECK(in.check(in.wanted()).outcome == start_outcome::ready);
    CHECK(in.check(in.wanted({{"speed", "41"}})).outcome == start_outcome::bad_argument);
    auto far = in.wanted();
    far.listen = {"tcp://0.0.0.0:7411"};
    auto forbidden = in.check(far);
    CHECK(forbidden.outcome == start_outcome::bad_argument);
    CHECK_THAT(forbidden.why, Contains("--allow-address"));
    in.system.start("boat", "other", [](ise::node& node) {
        node.start("sea/wind", [](ise::component& self) -> ise::task<> { co_await self.sleep(24h); });
    });
    REQUIRE(in.system.world.run_until([&] { return in.system.holds("sea/wind"); }, 30s));
    auto held = in.check(in.wanted());
    CHECK(held.outcome == start_outcome::name_taken);
    CHECK_THAT(held.why, Contains("'sea/wind' is held by process"));
    CHECK(in.host.launches.empty());
}

TEST_CASE("two that need the same port are told before either is started") {
    harbour in;
    checks_request request;
    for (const char* path : {"sea/one", "sea/two"}) {
        auto one = in.wanted();
        one.path = path;
        one.listen = {"tcp://127.0.0.1:7411"};
        request.wanted.push_back(one);
    }
    auto result = in.call(host_services::check, request).value().checked;
    CHECK(result.at(0).outcome == start_outcome::ready);
    CHECK(result.at(1).outcome == start_outcome::address_in_use);
    CHECK_THAT(result.at(1).why, Contains("another component of the file listens on tcp://127.0.0.1:7411 too"));
}

TEST_CASE("a port that another process listens on is told before anything is started") {
    harbour in;
    in.system.start("shore", "other", [](ise::node& node) {
        node.start(
            "", [](ise::component& self) -> ise::task<> { co_await self.sleep(24h); },
            names_test::everywhere("tcp://127.0.0.1:7411"));
    });
    in.system.world.run_for(1s);
    auto one = in.wanted();
    one.listen = {"tcp://127.0.0.1:7411"};
    CHECK(in.check(one).outcome == start_outcome::address_in_use);
    one.listen = {"tcp://127.0.0.1:7412"};
    CHECK(in.check(one).outcome == start_outcome::ready);
}

TEST_CASE("what has failed is no trouble any more once it was stopped") {
    harbour in;
    in.start();
    auto to = in.wanted({{"speed", "8"}});
    to.terms.policy = restart_policy::never;
    REQUIRE(in.change(to));
    in.host.end(in.host.at("sea/wind"), {true, true, 9});
    in.system.world.run_for(2min);
    REQUIRE(in.instances().front().state == instance_state::failed);
    stop_request request;
    request.path = "sea/wind";
    auto ended = in.call(host_services::stop, request).value().ended;
    CHECK(ended.state == instance_state::stopped);
    CHECK_THAT(ended.reason, Contains("stopped after it had failed: "));
}

TEST_CASE("a stop during a change is the last word, and leaves no process that nobody tracks") {
    for (bool forget : {false, true}) {
        INFO("forget " << forget);
        harbour in;
        in.start();
        change_request request;
        request.to = in.wanted({{"speed", "8"}, {"course", "reef"}}); // never ready
        auto changed = in.ask(host_services::change, request);
        REQUIRE(in.system.world.run_until([&] { return in.host.launches.size() == 2; }, 1min));
        in.system.world.run_for(1s);
        stop_request stop;
        stop.path = "sea/wind";
        stop.forget = forget;
        CHECK(in.call(host_services::stop, stop).value().ended.state == instance_state::stopped);
        REQUIRE(in.system.world.run_until([&] { return changed->has_value(); }, 1h));
        auto result = (*changed)->value();
        CHECK(result.outcome.outcome == start_outcome::exited);
        CHECK(result.undo == 0);
        in.system.world.run_for(1min);
        CHECK(in.host.running().empty());
        CHECK(in.host.launches.size() == 2);
        auto left = in.instances();
        CHECK(left.size() == (forget ? 0 : 1));
        for (const auto& one : left) { // what it was before the change
            CHECK(one.state == instance_state::stopped);
            CHECK(one.arguments.size() == 1);
        }
    }
}

TEST_CASE("a component goes on as before where the one who restarts or changes it is lost meanwhile") {
    for (bool change : {false, true}) {
        INFO("change " << change);
        harbour in;
        in.start();
        auto& client = in.system.start("shore", "client", [&](ise::node& node) {
            node.start("", [change](ise::component& self) -> ise::task<> {
                auto its = self.at("ise/host/shore");
                change_request other;
                other.to = harbour::wanted({{"speed", "8"}, {"course", "reef"}}); // never ready
                restart_request same{"sea/wind"};
                if (change) {
                    [[maybe_unused]] auto got = co_await its.try_call(host_services::change, std::move(other), 5min);
                } else {
                    [[maybe_unused]] auto got = co_await its.try_call(host_services::restart, std::move(same), 5min);
                }
            });
        });
        REQUIRE(in.system.world.run_until([&] { return in.host.launches.size() == 2; }, 1min));
        client.crash();
        in.system.world.run_for(1min);
        CHECK(in.host.running().size() == 1);
        CHECK(in.host.launches.size() == (change ? 3 : 2));
        CHECK_FALSE(in.has_word("--course=reef"));
        auto left = in.instances().front();
        CHECK(left.state == instance_state::ready);
        CHECK(left.arguments.size() == 1);
    }
}

TEST_CASE("what did not run is ended where the one who changes it is lost meanwhile, and so is a first start") {
    for (bool change : {false, true}) {
        INFO("change " << change);
        harbour in;
        if (change) {
            in.start();
            in.call(host_services::stop, stop_request{"sea/wind"}).value();
        }
        auto before = in.host.launches.size();
        auto& client = in.system.start("shore", "client", [&](ise::node& node) {
            node.start("", [change](ise::component& self) -> ise::task<> {
                auto its = self.at("ise/host/shore");
                auto reef = harbour::wanted({{"course", "reef"}});
                change_request other;
                other.to = reef;
                if (change) {
                    [[maybe_unused]] auto got = co_await its.try_call(host_services::change, std::move(other), 5min);
                } else {
                    [[maybe_unused]] auto got = co_await its.try_call(host_services::start, std::move(reef), 5min);
                }
            });
        });
        REQUIRE(in.system.world.run_until([&] { return in.host.launches.size() > before; }, 1min));
        in.system.world.run_for(100ms);
        client.crash();
        in.system.world.run_for(8s); // sooner than its deadline
        CHECK(in.host.running().empty());
        CHECK(in.instances().front().state == instance_state::stopped);
        if (change) CHECK(in.instances().front().arguments.front().name == "speed");
    }
}

TEST_CASE("what is stopped while its launch waits for its name stays stopped") {
    harbour in;
    auto what = in.wanted({{"speed", "8"}});
    what.terms.ready_within = 200ms;
    what.terms.first_pause = what.terms.max_pause = 1s;
    what.terms.limit = 100;
    REQUIRE(in.call(host_services::start, what).value().outcome == start_outcome::ready);
    // It has a session already: names cannot be resolved later.
    auto seen = std::make_shared<std::optional<instance_state>>();
    auto ended = std::make_shared<std::optional<ise::result<ended_response>>>();
    auto may_stop = std::make_shared<bool>(false);
    in.system.start("shore", "client", [&](ise::node& node) {
        node.start("", [seen, ended, may_stop](ise::component& self) -> ise::task<> {
            auto its = self.at("ise/host/shore");
            for (;;) {
                instances_request all;
                auto got = co_await its.try_call(host_services::instances, std::move(all), 1s);
                if (got && !got->instances.empty()) *seen = got->instances.front().state;
                if (*may_stop && !*ended && *seen == instance_state::waiting) {
                    stop_request stop;
                    stop.path = "sea/wind";
                    auto outcome = co_await its.try_call(host_services::stop, std::move(stop), 30s);
                    ended->emplace(std::move(outcome));
                }
                co_await self.sleep(20ms);
            }
        });
    });
    auto& world = in.system.world;
    world.run_for(1s);
    in.system.server->pause();
    in.host.end(in.host.at("sea/wind"), {true, true, 9});
    REQUIRE(world.run_until([&] { return *seen == instance_state::starting; }, 10s));
    *may_stop = true;
    REQUIRE(world.run_until([&] { return ended->has_value(); }, 10s));
    CHECK((*ended)->value().ended.state == instance_state::stopped);
    world.run_for(4s); // the launch gives up the name
    CHECK(*seen == instance_state::stopped);
    in.system.server->go_on();
    world.run_for(20s);
    CHECK(*seen == instance_state::stopped);
    CHECK(in.host.running().empty());
}

TEST_CASE("an instance that was taken over is not started again as what the rules do not allow any more") {
    const auto* found = ::getpwuid(::geteuid());
    REQUIRE(found);
    const std::string user = found->pw_name;
    launch_rules wide;
    wide.users = {user};
    wide.as_root = true; // the test may be root
    harbour in(wide);
    auto what = in.wanted({{"speed", "8"}});
    what.user = user;
    REQUIRE(in.call(host_services::start, what).value().outcome == start_outcome::ready);
    in.server->crash();
    in.system.world.run_for(10s);
    in.rules = launch_rules();
    in.open();
    auto again = in.call(host_services::restart, restart_request{"sea/wind"}).value();
    CHECK(again.outcome == start_outcome::bad_argument);
    CHECK_THAT(again.why, Contains("'" + user + "'"));
    CHECK(in.instances().front().state == instance_state::ready); // it runs on
    in.host.end(in.host.at("sea/wind"), {true, true, 9});
    in.system.world.run_for(10min);
    CHECK(in.host.launches.size() == 1);
    CHECK(in.instances().front().state == instance_state::failed);
    CHECK_THAT(in.instances().front().reason, Contains("'" + user + "'"));
}

} // namespace changing_test
