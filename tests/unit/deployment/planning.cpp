// From what runs to what is wanted: which steps, in which order.
#include "files.hpp"

#include <ise/component/component_type.hpp>
#include <ise/deployment/ordering.hpp>
#include <ise/deployment/planning.hpp>

namespace planning_test {

using namespace deployment_test;
using ise::instantiation::instance_info;
using ise::instantiation::instance_state;
using ise_test::Contains;

namespace {

struct ping {};
inline constexpr ise::request_response<ping, ping> radio{"radio"};
inline constexpr ise::request_response<ping, ping> sails{"sails"};

struct values {
    double speed = 5;
    std::string course = "T1";
    std::uint64_t address = 0x13A2;
    std::vector<std::string> marks;
};

std::vector<ise::instantiation::catalogue_type> types() {
    static values bound;
    std::vector<ise::component_type> made;
    made.emplace_back("boat", "sails", "");
    auto& set = made.back().parameters;
    set.add("speed", bound.speed, "of the wind").range(0, 40).unit("m/s").changeable();
    set.add("course", bound.course, "what it sails").one_of({"T1", "T2"});
    set.add("address", bound.address, "of the modem").kind(ise::parameter_kind::hexadecimal).preset("13A2");
    set.add("mark", bound.marks, "to round");
    made.back().provides(sails).reads("BOAT_NAME");
    made.emplace_back("air", "between modems", "");
    made.back().provides(radio).requires_(sails);
    made.emplace_back("proxy", "of the boat", "");
    made.back().requires_(radio);
    std::vector<ise::instantiation::catalogue_type> all;
    for (auto& one : made) {
        all.push_back({"sea", one.about});
        all.back().about.parameters = one.parameters.all();
    }
    return all;
}

/// Two hosts, and what `up` made of them so far.
struct harbour {
    std::vector<host_state> hosts{{"boat", types(), {}}, {"shore", types(), {}}};

    deployment completed(const files& from) {
        auto wanted = from.made();
        std::vector<problem> problems;
        complete(wanted, hosts, problems);
        for (const auto& one : problems) UNSCOPED_INFO(one.text());
        REQUIRE(problems.empty());
        return wanted;
    }
    std::string wrong(const files& from) {
        auto wanted = from.made();
        std::vector<problem> problems;
        complete(wanted, hosts, problems);
        std::string text;
        for (const auto& one : problems) text += one.text() + "\n";
        return text;
    }
    step_plan up(const files& from) { return plan_up(completed(from), hosts); }
    /// The steps, each in a line.
    std::string steps(const files& from) { return lines(up(from)); }
    static std::string lines(const step_plan& of) {
        std::string text;
        for (const auto& one : of.problems) text += "problem: " + one.text() + "\n";
        for (const auto& one : of.steps) text += as_text(one, true) + "\n";
        return text;
    }
    /// As if it had been carried out.
    void carry_out(const files& from) {
        for (const auto& one : up(from).steps) {
            auto& host = one.server == "boat" ? hosts[0] : hosts[1];
            std::erase_if(host.instances, [&](const auto& each) { return each.path == one.path; });
            if (one.what == action::stop) continue;
            instance_info made;
            made.path = one.path;
            made.type = one.request.type;
            made.state = instance_state::ready;
            made.terms = one.request.terms;
            made.arguments = one.request.arguments;
            made.listen = one.request.listen;
            made.protocol = one.request.protocol;
            made.roles = one.request.roles;
            made.deployment = one.request.deployment;
            for (const auto& each : one.request.variables) made.variables.push_back({each.name, {}});
            host.instances.push_back(made);
        }
    }
    instance_info& instance(const std::string& path) {
        for (auto& host : hosts)
            for (auto& one : host.instances)
                if (one.path == path) return one;
        throw std::logic_error("nothing runs at " + path);
    }
};

files two(const std::string& boat = "", const std::string& air = "") {
    return at_sea("[components.boat]\ntype='boat'\nhost='boat'\n" + boat +
                  "[components.air]\ntype='air'\nhost='shore'\n" + air);
}

} // namespace

TEST_CASE("required services give the order where nothing else does") {
    harbour in;
    auto text = in.steps(at_sea("[components.p]\ntype='proxy'\nhost='shore'\n[components.a]\ntype='air'\nhost='boat'\n["
                                "components.b]\ntype='boat'\nhost='boat'\n"));
    CHECK(text == "start sea/b on boat\nstart sea/a on boat\nstart sea/p on shore\n");
}

TEST_CASE("two of a type that require what each of them provides are equals: the file gives their order") {
    harbour in;
    for (auto& host : in.hosts)
        host.types[2].about.services.insert(host.types[2].about.services.end(), {{"notes", "request-response", true},
                                                                                 {"notes", "request-response", false}});
    auto text = in.steps(at_sea("[components.p]\ntype='proxy'\nhost='shore'\n[components.q]\ntype='proxy'\nhost='boat'"
                                "\n[components.a]\ntype='air'\nhost='boat'\n"));
    CHECK(text == "start sea/a on boat\nstart sea/p on shore\nstart sea/q on boat\n");
}

TEST_CASE("what is said stands above what services require") {
    harbour in;
    auto text = in.steps(
        at_sea("[components.b]\ntype='boat'\nhost='boat'\nafter='a'\n[components.a]\ntype='air'\nhost='boat'\n"));
    CHECK(text == "start sea/a on boat\nstart sea/b on boat\n");
}

TEST_CASE("circles are told") {
    harbour in;
    auto said = in.steps(at_sea("[components.a]\ntype='proxy'\nhost='boat'\nafter='c'\n[components.b]\ntype='proxy'"
                                "\nhost='boat'\nafter='a'\n[components.c]\ntype='proxy'\nhost='boat'\nafter='b'\n"));
    CHECK(said == "problem: sea.toml:4:13: components wait for each other: 'a' comes after 'c', 'c' comes after 'b', "
                  "'b' comes after 'a'\n");
}

TEST_CASE("components that require each other are started all the same, and who is first waits") {
    harbour in;
    in.hosts[0].types[0].about.services.push_back(
        {"radio", "request-response", false}); // boats need the air, and the air boats
    auto derived =
        in.steps(at_sea("[components.b]\ntype='boat'\nhost='boat'\n[components.a]\ntype='air'\nhost='boat'\n"));
    CHECK(derived == "start sea/a on boat\nstart sea/b on boat\n");
    auto decided = in.steps(
        at_sea("[components.b]\ntype='boat'\nhost='boat'\nafter=[]\n[components.a]\ntype='air'\nhost='boat'\n"));
    CHECK(decided == "start sea/b on boat\nstart sea/a on boat\n");
}

TEST_CASE("what runs as it is wanted is left alone") {
    harbour in;
    auto file =
        two("parameters={speed=6, mark=['x','y'], address=0x13A3}\nenvironment={BOAT_NAME='A'}\nroles={fleet=1}\n");
    in.carry_out(file);
    auto plan = in.up(file);
    CHECK(plan.steps.empty());
    CHECK(plan.kept == std::vector<std::string>{"sea/boat", "sea/air"});
    CHECK(in.instance("sea/boat").arguments.back().value == "13A3");
}

TEST_CASE("the same value written otherwise, or the preset, is no change") {
    harbour in;
    in.carry_out(two("parameters={speed=6, address='000013a2'}\n"));
    in.instance("sea/boat").arguments = {{"speed", "6.0"}};
    CHECK(in.steps(two("parameters={speed=6, course='T1'}\n")).empty());
}

TEST_CASE("a changeable parameter is changed while it runs") {
    harbour in;
    in.carry_out(two("parameters={speed=6}\n"));
    auto plan = in.up(two("parameters={speed=7}\n"));
    CHECK(harbour::lines(plan) == "change sea/boat on boat\n    speed: 6 -> 7\n");
    REQUIRE(plan.steps[0].differences[0].setting);
    CHECK(plan.steps[0].differences[0].setting->value == "7");
    CHECK(in.steps(two()) == "change sea/boat on boat\n    speed: 6 -> 5\n"); // the preset
    CHECK(in.steps(two("parameters={speed=6}\nrestart='always'\n")) ==
          "change sea/boat on boat\n    terms of restart\n");
}

TEST_CASE("other changes take a restart, and say which") {
    harbour in;
    in.carry_out(two("parameters={speed=6}\n"));
    CHECK(in.steps(two("parameters={speed=7, course='T2'}\n")) ==
          "restart sea/boat on boat\n    speed: 6 -> 7\n    course: T1 -> T2  (takes a restart)\n");
    CHECK_THAT(in.steps(two("parameters={speed=6, mark='x'}\n")), Contains("mark: (none) -> x  (takes a restart)"));
    CHECK_THAT(in.steps(two("parameters={speed=6}\nroles={fleet=2}\n")),
               Contains("restart sea/boat") && Contains("roles: (none) -> fleet=2"));
    CHECK_THAT(in.steps(two("parameters={speed=6}\nlisten='tcp://127.0.0.1:7500'\n")),
               Contains("endpoints: (none) -> tcp://127.0.0.1:7500"));
    auto secretive = two("parameters={speed=6}\nenvironment={BOAT_NAME='secret'}\n");
    in.hosts[0].checked["sea/boat"].other_environment = true; // only the host can tell
    CHECK_THAT(in.steps(secretive), Contains("    environment  (takes a restart)") && !Contains("secret"));
    in.hosts[0].checked.clear();
    in.instance("sea/boat").rebuilt = true;
    CHECK(in.steps(two("parameters={speed=6}\n")) ==
          "restart sea/boat on boat\n    program was rebuilt  (takes a restart)\n");
    in.instance("sea/boat").rebuilt = false;
    in.instance("sea/boat").state = instance_state::waiting; // it cannot be asked to change now
    in.instance("sea/boat").reason = "exit code 3";
    CHECK_THAT(in.steps(two("parameters={speed=7}\n")), Contains("restart sea/boat"));
    CHECK(in.steps(two("parameters={speed=6}\n")) ==
          "restart sea/boat on boat (it waits to be started again: exit code 3)\n");
}

TEST_CASE("what a host has against a start is told with its place, and nothing is begun") {
    using ise::instantiation::start_outcome;
    harbour in;
    in.hosts[1].checked["sea/air"] = {start_outcome::address_in_use, "tcp://127.0.0.1:7411 is in use", false};
    CHECK(in.steps(two()) == "problem: sea.toml:7:13: tcp://127.0.0.1:7411 is in use\n");
    in.hosts[1].checked["sea/air"] = {start_outcome::name_taken, "'sea/air' is held by process 7 on boat", false};
    CHECK_THAT(in.steps(two()), Contains("problem: sea.toml:7:13: 'sea/air' is held by process 7"));
    // That process is the one that this stops first.
    in.hosts[1].checked.clear();
    in.carry_out(at_sea("[components.boat]\ntype='boat'\nhost='boat'\n[components.air]\ntype='air'\nhost='boat'\n"));
    in.hosts[1].checked["sea/air"] = {start_outcome::name_taken, "'sea/air' is held by process 7 on boat", false};
    CHECK(in.steps(two()) == "stop sea/air on boat (it moves to shore)\nstart sea/air on shore (it moves from boat)\n");
}

TEST_CASE("what is not in the file any more is stopped first, and what moves right before it starts") {
    harbour in;
    in.carry_out(at_sea("[components.boat]\ntype='boat'\nhost='boat'\n[components.air]\ntype='air'\nhost='boat'\n["
                        "components.old]\ntype='boat'\nhost='shore'\n"));
    auto text = in.steps(at_sea("[components.new]\ntype='boat'\nhost='boat'\n[components.boat]\ntype='boat'\nhost='"
                                "shore'\n[components.air]\ntype='air'\nhost='boat'\n"));
    CHECK(text == "stop sea/old on shore (it is not in the file any more)\nstart sea/new on boat\nstop sea/boat on "
                  "boat (it moves to shore)\n"
                  "start sea/boat on shore (it moves from boat)\n");
}

TEST_CASE("what has ended is started again, with the reason") {
    harbour in;
    in.carry_out(two());
    in.instance("sea/boat").state = instance_state::failed;
    in.instance("sea/boat").reason = "exit code 3";
    in.instance("sea/air").state = instance_state::stopped;
    CHECK(in.steps(two()) ==
          "start sea/boat on boat (it has failed: exit code 3)\nstart sea/air on shore (it was stopped)\n");
}

TEST_CASE("what others have started is never touched") {
    harbour in;
    in.carry_out(two());
    in.instance("sea/boat").deployment = "";
    in.instance("sea/air").deployment = "other";
    auto text = in.steps(two());
    CHECK_THAT(text, Contains("sea.toml:4:13: 'sea/boat' runs on boat already, and was started by hand: stop it first "
                              "(ise stop sea/boat)"));
    CHECK_THAT(text, Contains("'sea/air' runs on shore already, as a part of 'other'"));
    CHECK_THAT(text, !Contains("start sea"));
    CHECK(plan_down(two().made(), in.hosts).steps.empty());
}

TEST_CASE("down ends everything in the opposite order, what the file does not know first") {
    harbour in;
    in.carry_out(at_sea("[components.boat]\ntype='boat'\nhost='boat'\n[components.air]\ntype='air'\nhost='boat'\n["
                        "components.old]\ntype='boat'\nhost='shore'\n"));
    in.instance("sea/boat").state = instance_state::failed;
    auto plan = plan_down(two().made(), in.hosts);
    CHECK(harbour::lines(plan) == "stop sea/old on shore\nstop sea/air on boat\nstop sea/boat on boat (it is over)\n");
    in.hosts[0].types.clear(); // programs may have gone meanwhile
    in.hosts[1].types.clear();
    CHECK(plan_down(two().made(), in.hosts).steps.size() == 3);
}

TEST_CASE("a step waits for those of the components that its own comes after, and for no others") {
    harbour in;
    auto file = at_sea("[components.a]\ntype='boat'\nhost='boat'\nafter=[]\n[components.b]\ntype='boat'\nhost='shore'"
                       "\nafter=[]\n[components.c]\ntype='boat'\nhost='boat'\nafter=['a','b']\n"
                       "[components.d]\ntype='boat'\nhost='boat'\nafter='c'\n");
    using numbers = std::vector<std::size_t>;
    auto after = [](const step_plan& of) {
        std::vector<numbers> all;
        for (const auto& one : of.steps) all.push_back(one.after);
        return all;
    };
    CHECK(after(in.up(file)) == std::vector<numbers>{{}, {}, {0, 1}, {2}});
    in.carry_out(file);
    in.instance("sea/a").state = in.instance("sea/d").state = instance_state::failed;
    CHECK(after(in.up(file)) == std::vector<numbers>{{}, {0}}); // through what is as it should be
    CHECK(after(plan_down(file.made(), in.hosts)) == std::vector<numbers>{{}, {0}, {1}, {1}});
}

TEST_CASE("what moves is stopped before it is started, and what the file does not know any more before everything") {
    harbour in;
    in.carry_out(at_sea("[components.boat]\ntype='boat'\nhost='boat'\n[components.old]\ntype='boat'\nhost='shore'\n"));
    auto plan = in.up(at_sea("[components.boat]\ntype='boat'\nhost='shore'\nafter=[]\n"));
    REQUIRE(plan.steps.size() == 3);
    CHECK(plan.steps[1].after == std::vector<std::size_t>{0});
    CHECK(plan.steps[2].after == std::vector<std::size_t>{0, 1});
}

TEST_CASE("some components are planned with those that they come after, and nothing else is touched") {
    harbour in;
    auto file = at_sea("[components.a]\ntype='boat'\nhost='boat'\nafter=[]\n[components.b]\ntype='boat'\nhost='boat'"
                       "\nafter='a'\n[components.c]\ntype='boat'\nhost='boat'\nafter='b'\n");
    in.carry_out(at_sea("[components.old]\ntype='boat'\nhost='boat'\n"));
    auto only = [&](std::vector<std::string> names) {
        return harbour::lines(plan_up(in.completed(file), in.hosts, names));
    };
    CHECK(only({"b"}) == "start sea/a on boat\nstart sea/b on boat\n");
    CHECK(only({"sea/a"}) == "start sea/a on boat\n");
    CHECK_THAT(only({"bb"}), Contains("there is no component 'bb' in it; did you mean 'b'?") && !Contains("start"));
    in.carry_out(file);
    CHECK(harbour::lines(plan_down(file.made(), in.hosts, {"b"})) == "stop sea/b on boat\n");
}

TEST_CASE("a file is checked against what the hosts have") {
    harbour in;
    auto text = in.wrong(at_sea(R"([components.a]
type = "baot"
host = "boat"
[components.b]
type = "boat"
host = "shore"
parameters = { sped = 1, course = "T3", speed = [1, 2], address = "xyz" }
environment = { BOAT = "x" }
)"));
    CHECK_THAT(text, Contains("sea.toml:5:8: host 'boat' has no component type 'baot'; did you mean 'boat'?"));
    CHECK_THAT(text, Contains("sea.toml:10:16: type 'boat' has no parameter 'sped'; did you mean 'speed'?"));
    CHECK_THAT(text, Contains("parameter 'course' cannot be 'T3': it must be one of T1, T2"));
    CHECK_THAT(text, Contains("parameter 'speed' of type 'boat' takes one value, not 2"));
    CHECK_THAT(text, Contains("parameter 'address' cannot be 'xyz': it must be 1 to 16 hexadecimal digits"));
    CHECK_THAT(text, Contains("type 'boat' does not let others set the environment variable 'BOAT'"));
    CHECK_THAT(in.wrong(two("parameters={speed=41}\n")),
               Contains("sea.toml:7:19: parameter 'speed' cannot be '41': it must be a number from 0 to 40 (m/s)"));
}

TEST_CASE("a type that a host does not have is told once, by the host's name in the file") {
    harbour in;
    auto one = [](const std::string& name, const std::string& host) {
        return "[components." + name + "]\ntype='wind'\nhost='" + host + "'\n";
    };
    auto text = in.wrong(files("name='sea'\n[hosts.vessel]\nserver='boat'\n[hosts.shore]\n" + one("a", "vessel") +
                               one("b", "shore") + one("c", "vessel")));
    CHECK(text == "sea.toml:6:6: host 'vessel' (instantiation server 'boat') has no component type 'wind', which 2 "
                  "components need; there are boat, air, proxy\n"
                  "sea.toml:9:6: host 'shore' has no component type 'wind'; there are boat, air, proxy\n");
}

TEST_CASE("a host without an instantiation server is told, if something is to run there") {
    harbour in;
    in.hosts.pop_back();
    CHECK_THAT(
        in.wrong(two()),
        Contains("sea.toml:3:8: no instantiation server 'shore' is registered; there are boat; start it on that host"));
    CHECK(in.wrong(at_sea("[components.b]\ntype='boat'\nhost='boat'\n")).empty());
}

} // namespace planning_test
