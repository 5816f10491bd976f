// Deployment files: what they say, and what is wrong with them, with its place.
#include "files.hpp"

#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <map>
#include <test_folders.hpp>

namespace reading_test {

using namespace deployment_test;
using namespace std::chrono_literals;
using ise::instantiation::restart_policy;
using ise_test::Contains;

TEST_CASE("defaults hold for each component that does not say otherwise") {
    auto made = files(R"(
name = "atirma"
[hosts.boat]
[defaults]
restart = { policy = "always", limit = 9 }
ready-within = "40s"
[components.air]
type = "xbee-link"
[components.boat]
type = "boat-simulator"
restart = "never"
[components.page]
type = "web-server"
restart = { policy = "on-failure" }
grace = "9s"
)")
                    .made();
    REQUIRE(made.components.size() == 3);
    const auto& air = made.components[0].request.terms;
    CHECK(air.policy == restart_policy::always);
    CHECK(air.limit == 9);
    CHECK(air.ready_within == 40s);
    const auto& boat = made.components[1].request.terms;
    CHECK(boat.policy == restart_policy::never);
    CHECK(boat.ready_within == 40s);
    const auto& page = made.components[2].request.terms;
    CHECK(page.policy == restart_policy::on_failure);
    CHECK(page.limit == 9);
    CHECK(page.grace == 9s);

    const std::string two = "[components.a]\ntype='t'\nhost='boat'\n[components.b]\ntype='t'\nhost='boat'\n";
    CHECK(at_sea("[defaults]\nrestart='sometimes'\n" + two).wrong() ==
          "sea.toml:5:9: the restart policy of the components is never, on-failure or always, not 'sometimes'\n");
    CHECK_THAT(at_sea("[defaults]\ntype='t'\n" + two).wrong(), Contains("sea.toml:5:1: 'defaults' has no key 'type'"));
    CHECK_THAT(at_sea(two + "[[defaults]]\nx=1\n").wrong(), Contains("a table of keys of components"));
}

TEST_CASE("a component with copies is there once for each number, and a namespace of its own is its path") {
    auto fleet = files(R"(
name = "atirma"
[variables]
boats = 1
[hosts.boat]
[components.boat]
type = "t"
[components."boat-{n}/boat"]
copies = { first = 2, last = "${boats}" }
namespace = ""
type = "t"
after = ["boat-{n}/shore"]
parameters = { id = "boat-{n}", seed = "{n}", list = ["a-{n}"], digits = "1{nnn}{n}{nx}" }
[components."boat-{n}/shore"]
copies = { first = 2, last = "${boats}" }
type = "t"
)");
    CHECK(fleet.made().components.size() == 1);
    auto made = fleet.made({{"boats", "3"}});
    REQUIRE(made.components.size() == 5);
    const auto& last = made.components[2];
    CHECK(last.name.text == "boat-3/boat");
    CHECK(last.request.path == "boat-3/boat");
    CHECK(made.components[4].request.path == "atirma/boat-3/shore");
    REQUIRE(last.after->size() == 1);
    CHECK(last.after->front().text == "boat-3/shore");
    std::map<std::string, std::string> given;
    for (const auto& [name, values] : last.parameters) given[name.text] = values.front().text;
    CHECK(given == std::map<std::string, std::string>{
                       {"id", "boat-3"}, {"seed", "3"}, {"list", "a-3"}, {"digits", "10033{nx}"}});

    auto wrong = [](const std::string& key, const std::string& copies) {
        return at_sea("[components." + key + "]\ntype='t'\nhost='boat'\ncopies = " + copies + "\n").wrong();
    };
    CHECK_THAT(wrong("'b{n}'", "3"), Contains("is a table of two whole numbers: { first = 2, last = 5 }"));
    CHECK_THAT(wrong("'b{n}'", "{ first = 1, last = 'x' }"), Contains("two whole numbers"));
    CHECK_THAT(wrong("'b{n}'", "{ first = 1, last = 1000000 }"), Contains("at most 256 of them, not 1 to 1000000"));
    CHECK_THAT(wrong("b", "{ first = 1, last = 2 }"), Contains("has copies of one name: write {n} for the number"));
}

TEST_CASE("a deployment file says what runs where, with what") {
    auto made = files(R"(
name = "atirma"

[hosts.boat]
[hosts.shore]
server = "lab"

[components.air]
type = "xbee-link"
host = "boat"
[components.air.parameters]
loss = 0.25
shore-port = "/tmp/a"
gusts = true
seed = 7
telemetry = ["a", "b"]

[components."shore/xbee"]
type = "xbee-proxy"
host = "shore"
listen = "tcp://127.0.0.1:7500"
after = ["air"]
restart = "always"
ready-within = "20s"
grace = 1.5
roles = { "atirma/gateway" = 5 }
environment = { NAME = "value" }
)")
                    .made();
    CHECK(made.name.text == "atirma");
    REQUIRE(made.hosts.size() == 2);
    CHECK(made.hosts[0].server == "boat");
    CHECK(made.hosts[1].server == "lab");
    REQUIRE(made.components.size() == 2);
    const auto& air = made.components[0];
    CHECK(air.name.text == "air");
    CHECK(air.name.at.text() == "sea.toml:8:13");
    CHECK(air.request.path == "atirma/air");
    CHECK(air.request.type == "xbee-link");
    CHECK(air.request.deployment == "atirma");
    CHECK(air.host.text == "boat");
    CHECK_FALSE(air.after);
    CHECK(air.request.terms == ise::instantiation::restart_terms());
    std::string parameters;
    for (const auto& one : air.parameters)
        for (const auto& each : one.values) parameters += one.name.text + "=" + each.plain() + " ";
    CHECK(parameters == "loss=0.25 shore-port=/tmp/a gusts=true seed=7 telemetry=a telemetry=b ");
    const auto& proxy = made.components[1];
    CHECK(proxy.request.path == "atirma/shore/xbee");
    CHECK(proxy.request.listen == std::vector<std::string>{"tcp://127.0.0.1:7500"});
    REQUIRE(proxy.after);
    CHECK(proxy.after->front().text == "air");
    CHECK(proxy.request.terms.policy == restart_policy::always);
    CHECK(proxy.request.terms.ready_within == 20s);
    CHECK(proxy.request.terms.grace == 1500ms);
    CHECK(proxy.request.roles.at("atirma/gateway") == 5);
    CHECK(proxy.request.variables.front().value == "value");
}

TEST_CASE("the terms of restart can be said in whole") {
    auto made = at_sea(R"([components.a]
type = "t"
host = "boat"
restart = { policy = "on-failure", limit = 9, window = "2m", first-pause = "100ms", max-pause = "5s" }
)")
                    .made();
    const auto& terms = made.components[0].request.terms;
    CHECK(terms.policy == restart_policy::on_failure);
    CHECK(terms.limit == 9);
    CHECK(terms.window == 2min);
    CHECK(terms.first_pause == 100ms);
    CHECK(terms.max_pause == 5s);
}

TEST_CASE("a namespace of its own, or none, stands before the names") {
    CHECK(files("name='d'\nnamespace='x/y'\n[hosts.h]\n[components.c]\ntype='t'\n").made().components[0].request.path ==
          "x/y/c");
    CHECK(files("name='d'\nnamespace=''\n[hosts.h]\n[components.c]\ntype='t'\n").made().components[0].request.path ==
          "c");
}

TEST_CASE("where there is one host, it need not be said") {
    CHECK(files("name='d'\n[hosts.h]\n[components.c]\ntype='t'\n").made().components[0].host.text == "h");
    CHECK_THAT(at_sea("[components.c]\ntype='t'\n").wrong(),
               Contains("sea.toml:4:13: component 'c' has no 'host', and there are several"));
}

TEST_CASE("what is wrong is told with its place, and the nearest that there is") {
    auto text = at_sea(R"([components.boat]
tpye = "simulator"
host = "baot"
after = ["air", "baot", "boat"]
restart = "sometimes"
listen = "tcp//x"
protocol = "icmp"
grace = "5 parsecs"
roles = { "a b" = 1, good = "high" }
parameters = { deep = { er = 1 } }
[colour]
)")
                    .wrong();
    CHECK_THAT(text, Contains("sea.toml:5:1: component 'boat' has no key 'tpye'; did you mean 'type'?"));
    CHECK_THAT(text, Contains("sea.toml:4:13: component 'boat' has no 'type': ise start --types"));
    CHECK_THAT(text, Contains("sea.toml:6:8: there is no host 'baot'; did you mean 'boat'?"));
    CHECK_THAT(text, Contains("sea.toml:7:10: there is no component 'air'"));
    CHECK_THAT(text, Contains("sea.toml:7:25: component 'boat' cannot come after itself"));
    CHECK_THAT(text,
               Contains("the restart policy of component 'boat' is never, on-failure or always, not 'sometimes'"));
    CHECK_THAT(text, Contains("sea.toml:9:10: 'listen' of component 'boat': "));
    CHECK_THAT(text,
               Contains("'protocol' of component 'boat' is one of tcp, udp, tls, udp+tls, local, shm, not 'icmp'"));
    CHECK_THAT(text, Contains("sea.toml:11:9: 'grace' of component 'boat': '5 parsecs' is not a duration"));
    CHECK_THAT(text, Contains("'a b' is not a role") && Contains("the priority in the role 'good' is an integer"));
    CHECK_THAT(text, Contains("parameter 'deep' is a text, a number, true or false, or an array of them, not a table"));
    CHECK_THAT(text, Contains("the deployment has no key 'colour'; there are name, namespace, hosts, components"));
}

TEST_CASE("limits and probes are read, and told with their place where they are wrong") {
    auto sea = at_sea("[components.a]\ntype='t'\nhost='boat'\nlimits={pids=64, memory='256 MiB', "
                      "cpus=0.5}\nprobe={url='http://127.0.0.1:8080/', every='5s', failures=2}\n"
                      "[components.b]\ntype='t'\nhost='boat'\nprobe='tcp://127.0.0.1:80'\n");
    auto result = sea.read();
    INFO(sea.wrong());
    REQUIRE(result.problems.empty());
    const auto& one = result.made.components[0].request;
    CHECK(one.limits == ise::instantiation::resource_limits{64, 256 << 20, 0.5});
    CHECK(one.terms.probe == "http://127.0.0.1:8080/");
    CHECK(one.terms.probe_every == 5s);
    CHECK(one.terms.probe_failures == 2);
    CHECK(result.made.components[1].request.terms.probe == "tcp://127.0.0.1:80");
    CHECK(result.made.components[1].request.limits == ise::instantiation::resource_limits());
    auto wrong = at_sea("[components.a]\ntype='t'\nhost='boat'\nlimits={pids=0, disk=5}\nprobe={every='5s'}\n").wrong();
    CHECK_THAT(wrong,
               Contains("the limit pids is a number of processes and threads from 1 to 32768, such as 64, not '0'"));
    CHECK_THAT(wrong, Contains("'limits' of component 'a' has no key 'disk'; there are pids, memory, cpus"));
    CHECK_THAT(wrong, Contains("'probe' of component 'a' has no 'url'"));
}

TEST_CASE("what is no TOML is told with its place") {
    CHECK_THAT(files("name = \n").wrong(), Contains("sea.toml:1:"));
    CHECK_THAT(files("name = 'a'\nname = 'b'\n").wrong(), Contains("sea.toml:2:") && Contains("name"));
    CHECK_THAT(files("name = 1979-05-27\n").wrong(), Contains("dates and times are no values here"));
    CHECK_THAT(files("").wrong(), Contains("no 'name'") && Contains("no host") && Contains("no component"));
}

TEST_CASE("characters beyond ASCII are for texts and comments, and refused elsewhere with their place") {
    CHECK_THAT(files("# año\nname = 'ñandú' # ø\n").wrong(), !Contains("not ASCII"));
    CHECK_THAT(files("name = 'a'\naño = 1\n").wrong(), Contains("sea.toml:2:2: a character that is not ASCII"));
}

TEST_CASE("A-Tirma's file gives the radio's key to the boat and to each proxy, and none unless one is set") {
    auto find = [](const std::string& path) -> ise::result<std::string> {
        std::ifstream in(path);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    const std::string file = std::string(ISE_SOURCE_DIR) + "/apps/atirma/atirma.toml";
    auto keys = [&](const settings& given) {
        std::map<std::string, std::string> made;
        auto parsed = read_deployment(file, find, given);
        for (const auto& one : parsed.problems) UNSCOPED_INFO(one.text());
        REQUIRE(parsed.problems.empty());
        for (const auto& one : parsed.made.components)
            for (const auto& parameter : one.parameters)
                if (parameter.name.text == "radio-key")
                    for (const auto& value : parameter.values) made[one.request.path] = value.plain();
        return made;
    };
    const std::map<std::string, std::string> wanted = {{"atirma/boat", "/etc/atirma/radio.key"},
                                                       {"atirma/shore/xbee", "/etc/atirma/radio.key"},
                                                       {"atirma/shore/gprs", "/etc/atirma/radio.key"},
                                                       {"atirma/shore/iridium", "/etc/atirma/radio.key"}};
    CHECK(keys({{"radio-key", "/etc/atirma/radio.key"}}) == wanted);
    for (const auto& [path, key] : keys({})) CHECK(key.empty());
}

TEST_CASE("the error for a text without quotes asks for quotes") {
    CHECK(files("name = boat\n").wrong() == "sea.toml:1:8: boat is not a value: put it in quotes, \"boat\"\n");
    CHECK_THAT(at_sea("[components.a]\ntype=trouble # ours\n").wrong(),
               Contains("sea.toml:5:6: trouble is not a value: put it in quotes, \"trouble\""));
    CHECK_THAT(files("[variables]\nports = /run/sea\n").wrong(), Contains("put it in quotes, \"/run/sea\""));
    CHECK_THAT(files("name = 'sea\n").wrong(), !Contains("put it in quotes"));
    CHECK_THAT(files("name = 'sea' = boat\n").wrong(), !Contains("put it in quotes"));
}

TEST_CASE("a variable that there is not is one mistake") {
    auto all = at_sea("[components.a]\ntype='${tpye}'\nhost='${hsot}'\nafter='${none}'\nlisten=['${none}']\nprotocol='"
                      "x-${none}'\nrestart='${none}'\ngrace='${none}'\nroles={b='${none}'}\n"
                      "parameters={speed='${none}', mark=['${none}']}\n[variables]\ntype='t'\n")
                   .wrong();
    std::size_t lines = 0, found = 0;
    for (std::size_t at = 0; (at = all.find('\n', at)) != all.npos; ++at) ++lines;
    for (std::size_t at = 0; (at = all.find("there is no variable", at)) != all.npos; ++at) ++found;
    INFO(all);
    CHECK(found == 10);
    CHECK(lines == found);
}

TEST_CASE("wrong kinds are told as such") {
    auto text = at_sea("[components.a]\ntype=5\nhost=['boat']\nparameters='none'\nroles=[]\nenvironment=1\nrestart=1\n")
                    .wrong();
    for (const char* each :
         {"'type' of component 'a' is a text, not an integer", "'host' of component 'a' is a text, not an array",
          "'parameters' of component 'a' is a table, not a text", "'roles' of component 'a' is a table of roles",
          "'environment' of component 'a' is a table of variables, not an integer",
          "'restart' of component 'a' is a policy"})
        CHECK_THAT(text, Contains(each));
    CHECK_THAT(files("name='d'\nhosts=5\ncomponents=6\n").wrong(),
               Contains("'hosts' is a table of hosts") && Contains("'components' is a table of components"));
}

TEST_CASE("paths that no component can have are refused") {
    CHECK_THAT(at_sea("[components.'a b']\ntype='t'\nhost='boat'\n").wrong(),
               Contains("'sea/a b' is not a path of a component"));
    CHECK_THAT(files("name='d'\nnamespace='ise'\n[hosts.h]\n[components.x]\ntype='t'\n").wrong(),
               Contains("'ise/x' is kept for ISE itself"));
    CHECK_THAT(files("name='d'\n[hosts.'a/b']\n[components.x]\ntype='t'\n").wrong(),
               Contains("'a/b' is not a name of an instantiation server"));
}

TEST_CASE("variables are put in, as what they are") {
    auto sea = at_sea(R"([components.a]
type = "t"
host = "${where}"
[components.a.parameters]
speed = "${speed}"
port = "${work}/port"
price = "5$$ and $ and $$${speed}"
[variables]
where = "boat"
speed = 2.5
work = "/tmp/${where}"
)");
    auto values = [](const deployment& of) {
        std::string text;
        for (const auto& one : of.components[0].parameters) text += one.name.text + "=" + one.values[0].plain() + "|";
        return text;
    };
    auto made = sea.made();
    CHECK(values(made) == "speed=2.5|port=/tmp/boat/port|price=5$ and $ and $2.5|");
    CHECK(made.components[0].parameters[0].values[0].is == value::kind::number);
    CHECK(made.components[0].host.text == "boat");
    auto other = sea.made({{"speed", "7"}, {"where", "shore"}});
    CHECK(values(other) == "speed=7|port=/tmp/shore/port|price=5$ and $ and $7|");
}

TEST_CASE("variables that are not there, or made of each other, are told") {
    auto sea = at_sea("[components.a]\ntype='${tpye}'\nhost='${x}'\nprotocol='${open'\n[variables]\ntype='t'\nx='${y}'"
                      "\ny='${x}'\nt={}\n");
    auto text = sea.wrong({{"spede", "1"}});
    CHECK_THAT(text, Contains("sea.toml:5:6: there is no variable 'tpye'; did you mean 'type'?"));
    CHECK_THAT(text, Contains("variables are made of each other: x of y of x"));
    CHECK_THAT(text, Contains("a '${' has no '}'"));
    CHECK_THAT(text, Contains("the variable 't' is a text, a number, true or false, not a table"));
    CHECK_THAT(text, Contains("--set: the file has no variable 'spede'; it has type, x, y"));
}

TEST_CASE("variables that double and double do not fill the memory") {
    std::string text = "[variables]\nv0='xxxxxxxxxxxxxxxx'\n";
    for (int n = 1; n < 40; ++n) text += fmt::format("v{0}='${{v{1}}}${{v{1}}}'\n", n, n - 1);
    CHECK_THAT(at_sea("[components.a]\ntype='${v39}'\nhost='boat'\n" + text).wrong(), Contains("bytes"));
}

TEST_CASE("a file stands above those that it includes") {
    auto sea = files(
        "include = ['lib/base.toml']\nname='sea'\n[components.a.parameters]\nspeed=9\n[variables]\nwhere='shore'\n");
    sea.all["lib/base.toml"] = "include='hosts.toml'\n[components.a]\ntype='t'\nhost='${where}'\nparameters={speed=1, "
                               "course='T1'}\n[variables]\nwhere='boat'\n";
    sea.all["lib/hosts.toml"] = "[hosts.boat]\n[hosts.shore]\n";
    auto made = sea.made();
    const auto& one = made.components.at(0);
    CHECK(one.host.text == "shore");
    CHECK(one.type.at.text() == "lib/base.toml:3:6");
    REQUIRE(one.parameters.size() == 2);
    CHECK(one.parameters[0].values[0].plain() == "9");
    CHECK(one.parameters[1].values[0].plain() == "T1");
}

TEST_CASE("files that cannot be included are told where they are named") {
    CHECK_THAT(files("include='gone.toml'\n").wrong(), Contains("sea.toml:1:9: gone.toml: No such file"));
    CHECK_THAT(files("include='sea.toml'\n").wrong(), Contains("files include each other: sea.toml includes sea.toml"));
    CHECK_THAT(files("include=[1]\n").wrong(), Contains("'include' names files"));
    auto deep = files("include='f0'\n");
    for (int n = 0; n < 40; ++n) deep.all[fmt::format("f{}", n)] = fmt::format("include='f{}'\n", n + 1);
    CHECK_THAT(deep.wrong(), Contains("files one in the other"));
}

TEST_CASE("a deployment file that is not there is told") {
    files none("");
    none.all.clear();
    CHECK_THAT(none.wrong(), Contains("sea.toml: sea.toml: No such file"));
}

} // namespace reading_test
