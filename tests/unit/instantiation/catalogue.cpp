// What a request comes to: words that cannot be taken for others than they are.
#include <ise/component/component_type.hpp>
#include <ise/instantiation/catalogue.hpp>

#include <support/catch.hpp>

#include <numeric>

namespace catalogue_test {

using namespace ise::instantiation;
using ise_test::Contains;

namespace {

struct boat_values {
    double speed = 5;
    std::string course = "T1";
    std::string log;
    std::uint8_t mode = 1;
    std::uint64_t address = 0x13A2;
    bool gusts = true;
    std::vector<std::string> marks{"buoy"};
    std::vector<std::string> posts;
    std::string page, gateway;
};

std::string described() {
    boat_values values;
    std::vector<ise::component_type> types;
    types.emplace_back("boat", "sails", "sea/boat");
    auto& set = types.back().parameters;
    set.add("speed", values.speed, "of the wind").range(0, 40).unit("m/s");
    set.add("course", values.course, "what it sails").one_of({"T1", "T2"});
    set.add("log", values.log, "where it writes").kind(ise::parameter_kind::path);
    set.add("mode", values.mode, "of the modem").range(0, 2);
    set.add("address", values.address, "of the modem").kind(ise::parameter_kind::hexadecimal).preset("13A2");
    set.add("gusts", values.gusts, "or none");
    set.add("mark", values.marks, "to round");
    set.add("post", values.posts, "where the gateway posts").kind(ise::parameter_kind::endpoint);
    set.add("shown-at", values.page, "of the page").kind(ise::parameter_kind::address);
    set.add("gateway", values.gateway, "that gets telecommands").kind(ise::parameter_kind::url);
    types.back().reads("BOAT_NAME");
    types.emplace_back("nameless", "has no path of its own");
    return ise::describe_types("boats", "1", types);
}

catalogue known() {
    catalogue made;
    made.add("boats", described());
    REQUIRE(made.problems().empty());
    return made;
}

start_request request(std::vector<argument> arguments = {}) {
    start_request made;
    made.type = "boat";
    made.arguments = std::move(arguments);
    return made;
}

std::string refusal(const start_request& what, const launch_rules& rules = {}) {
    auto made = known().plan(what, rules, 1);
    if (made) return "it was allowed";
    CHECK(made.error().code() == (what.type == "boot" ? ise::errc::no_such_name : ise::errc::invalid_argument));
    return made.error().message();
}

} // namespace

TEST_CASE("a request becomes a program and its words") {
    auto asked = request({{"speed", "7.5"}, {"mark", "a"}, {"mark", "b"}, {"address", "FFFFFFFFFFFFFFFF"}});
    asked.name_space = "test";
    asked.protocol = "tcp";
    asked.variables = {{"BOAT_NAME", "A-Tirma; rm -rf"}};
    auto made = known().plan(asked, {}, 1);
    REQUIRE(made);
    CHECK(made->program == "boats");
    CHECK(made->path == "test/sea/boat");
    CHECK(made->words == std::vector<std::string>{"run", "boat", "--path=test/sea/boat", "--listen=tcp://127.0.0.1:0",
                                                  "--speed=7.5", "--mark=a", "--mark=b", "--address=FFFFFFFFFFFFFFFF"});
    CHECK(made->variables == std::vector<std::pair<std::string, std::string>>{{"BOAT_NAME", "A-Tirma; rm -rf"}});
}

TEST_CASE("each parameter is refused with what is allowed") {
    CHECK(refusal(request({{"speed", "41"}})) ==
          "type 'boat': parameter 'speed' cannot be '41': it must be a number from 0 to 40 (m/s)");
    for (const char* value : {"nan", "inf", "", " 1", "1 ", "0x10", "1e400", "--x", "1\n"})
        CHECK(refusal(request({{"speed", value}})) != "it was allowed");
    CHECK_THAT(refusal(request({{"course", "T3"}})), Contains("it must be one of T1, T2"));
    CHECK_THAT(refusal(request({{"mode", "3"}})), Contains("an integer from 0 to 2"));
    CHECK_THAT(refusal(request({{"mode", "1.5"}})), Contains("an integer from 0 to 2"));
    CHECK_THAT(refusal(request({{"gusts", "yes"}})), Contains("it must be true or false"));
    CHECK_THAT(refusal(request({{"address", "10000000000000000"}})), Contains("1 to 16 hexadecimal digits"));
    CHECK_THAT(refusal(request({{"mark", std::string(5000, 'x')}})), Contains("has 5000 bytes, 4096 are allowed"));
    CHECK_THAT(refusal(request({{"mark", std::string("a\0b", 3)}})), Contains("control character"));
    CHECK_THAT(refusal(request({{"speed", "1"}, {"speed", "2"}})), Contains("given twice"));
    CHECK_THAT(refusal(request({{"path", "sea/other"}})), Contains("has no parameter 'path'; it has speed, course"));
    CHECK_THAT(refusal(request({{"sped", "1"}})),
               Contains("has no parameter 'sped'; did you mean 'speed'? it has speed, course"));
    CHECK_THAT(refusal(request({{"speed=1 --x", "1"}})), Contains("has no parameter"));
    CHECK_THAT(refusal(request(std::vector<argument>(300, argument{"mark", "a"}))), Contains("300 arguments"));
}

TEST_CASE("paths are allowed only below the folders of the rules") {
    launch_rules rules;
    rules.path_folders = {"/data/", "/dev/ttyUSB0"};
    for (const char* good : {"/data", "/data/x", "/data/x/y.csv", "/dev/ttyUSB0", ""})
        CHECK(refusal(request({{"log", good}}), rules) == "it was allowed");
    for (const char* bad :
         {"/database", "/", "/data/../etc", "/data/x/..", "data/x", "../data", "/dev/ttyUSB00", "/dev/ttyUSB1", "~/x"})
        CHECK_THAT(refusal(request({{"log", bad}}), rules), Contains("it must be a path below /data/ or /dev/ttyUSB0"));
    CHECK_THAT(refusal(request({{"log", "/data/x"}})), Contains("it allows none"));
}

TEST_CASE("parameters listen where components may, and nowhere else") {
    launch_rules open;
    open.listen_addresses.push_back("10.0.0.1");
    for (const char* good : {"tcp://127.0.0.1:7411", "udp://[::1]:0", "local://@boat", ""})
        CHECK(refusal(request({{"post", good}})) == "it was allowed");
    CHECK(refusal(request({{"post", "tcp://10.0.0.1:7411"}, {"shown-at", "10.0.0.1"}}), open) == "it was allowed");
    for (const char* bad : {"tcp://0.0.0.0:7411", "udp://10.0.0.2:0", "tcp://[::]:0", "tcp://localhost.evil.example:0",
                            "tcp://127.0.0.01:0"})
        CHECK_THAT(refusal(request({{"post", "tcp://127.0.0.1:0"}, {"post", bad}}), open),
                   Contains("parameter 'post' cannot be") &&
                       Contains("the addresses that this instantiation server allows are 127.0.0.1, ::1, 10.0.0.1 "
                                "(--allow-address)"));
    CHECK_THAT(refusal(request({{"post", "local:///etc/passwd"}})), Contains("local://@name"));
    CHECK_THAT(refusal(request({{"post", "127.0.0.1:80"}})), Contains("an endpoint to listen on"));
    CHECK_THAT(refusal(request({{"shown-at", "0.0.0.0"}})),
               Contains("parameter 'shown-at' cannot be '0.0.0.0'") && Contains("--allow-address"));
    CHECK_THAT(refusal(request({{"shown-at", "127.0.0.1 --x"}})), Contains("an address to listen on"));
    auto made = known().plan(request({{"post", "tcp://127.0.0.1:7411"}}), {}, 1);
    REQUIRE(made);
    CHECK(made->listen.at(0).text() == "tcp://127.0.0.1:7411"); // looked at before it is started
}

TEST_CASE("whatever a component will listen on is known before it starts: presets, and a port beside its address") {
    std::string page = "127.0.0.1";
    std::uint16_t port = 8080;
    std::vector<std::string> posts{"tcp://127.0.0.1:7420", "udp://127.0.0.1:7420"};
    std::vector<ise::component_type> types;
    types.emplace_back("page", "the page", "sea/page");
    auto& set = types.back().parameters;
    set.add("post", posts, "where the boat calls").kind(ise::parameter_kind::endpoint);
    set.add("shown-at", page, "to listen on").kind(ise::parameter_kind::address);
    set.add("shown-port", port, "to listen on").port_at("shown-at");
    catalogue known;
    known.add("pages", ise::describe_types("pages", "1", types));
    REQUIRE(known.problems().empty());
    auto listens = [&](std::vector<argument> arguments) {
        start_request asked;
        asked.type = "page";
        asked.arguments = std::move(arguments);
        auto made = known.plan(asked, {}, 1);
        REQUIRE(made);
        std::vector<std::string> all;
        for (const auto& at : made->listen) all.push_back(at.text());
        return all;
    };
    using list = std::vector<std::string>;
    CHECK(listens({}) == list{"tcp://127.0.0.1:7420", "udp://127.0.0.1:7420", "tcp://127.0.0.1:8080"});
    CHECK(listens({{"post", "tcp://127.0.0.1:1"}, {"shown-port", "81"}}) ==
          list{"tcp://127.0.0.1:1", "tcp://127.0.0.1:81"});
    CHECK(listens({{"post", ""}, {"shown-at", "::1"}}) == list{"tcp://[::1]:8080"});
}

TEST_CASE("a port whose address is no parameter of the type is told when the type is read") {
    std::uint16_t port = 8080;
    std::string page;
    std::vector<ise::component_type> types;
    types.emplace_back("page", "the page", "sea/page");
    types.back().parameters.add("shown-at", page, "a text");
    types.back().parameters.add("shown-port", port, "to listen on").port_at(GENERATE("shown-at", "nowhere"));
    catalogue known;
    known.add("pages", ise::describe_types("pages", "1", types));
    REQUIRE(known.problems().size() == 1);
    CHECK_THAT(known.problems().front(), Contains("the port 'shown-port' has no address"));
}

TEST_CASE("parameters name no host that the rules do not") {
    launch_rules open;
    open.target_hosts = {"gateway.example", "127.0.0.1:7411", "::1"};
    for (const char* good : {"https://gateway.example/post?x=1", "https://Gateway.Example:8443", "tcp://127.0.0.1:7411",
                             "imaps://gateway.example", "udp://[::1]:9", ""})
        CHECK(refusal(request({{"gateway", good}}), open) == "it was allowed");
    for (const char* bad : {"https://evil.example/", "https://gateway.example.evil.example/", "http://127.0.0.1:7412/",
                            "http://127.0.0.1/", "tcp://127.1:7411", "https://evil.example/gateway.example",
                            "https://evil.example#@gateway.example", "https://evil.example?gateway.example"})
        CHECK_THAT(refusal(request({{"gateway", bad}}), open),
                   Contains("this instantiation server allows parameters to name these hosts: gateway.example, "
                            "127.0.0.1:7411, ::1 (--allow-host"));
    for (const char* bad :
         {"https://gateway.example@evil.example/", "https://evil.example\\@gateway.example/", "gateway.example",
          "https:///x", "https://gateway.example:x/", "https://gateway.example:80:80/"})
        CHECK_THAT(refusal(request({{"gateway", bad}}), open), Contains("a URL to connect to"));
    for (const char* bad : {"local:///run/other.sock", "local://@other", "file:///etc/passwd"})
        CHECK_THAT(refusal(request({{"gateway", bad}}), open), Contains("reaches files or sockets of this host"));
    CHECK_THAT(refusal(request({{"gateway", "http://127.0.0.1:22/"}})),
               Contains("allows parameters to name these hosts: none (--allow-host 127.0.0.1:22)"));
}

TEST_CASE("an endpoint in a text is no way around the rules") {
    launch_rules open;
    open.target_hosts = {"10.0.0.7"};
    CHECK(refusal(request({{"mark", "xbee=atirma/shore/xbee"}})) == "it was allowed");
    CHECK(refusal(request({{"mark", "xbee=tcp://10.0.0.7:7411"}}), open) == "it was allowed");
    CHECK(refusal(request({{"mark", "postgresql://atirma@10.0.0.7/atirma"}}), open) == "it was allowed");
    for (const char* bad :
         {"postgresql://10.0.0.7:secret@10.0.0.7/x", "postgresql://@10.0.0.7/x", "postgresql://a@10.0.0.8@10.0.0.7/x"})
        CHECK_THAT(refusal(request({{"mark", bad}}), open), Contains("is not a URL"));
    for (const char* bad : {"postgresql://10.0.0.7@10.0.0.8/atirma",
                            "postgresql://a@10.0.0.7,10.0.0.8/x?a=tcp://10.0.0.8", "tcp://10.0.0.8:7411",
                            "xbee=tcp://10.0.0.8:7411", "Vela=tcp://10.0.0.7:1,tcp://10.0.0.8:1", "udp://[fd00::1]:9"})
        CHECK_THAT(refusal(request({{"mark", bad}}), open),
                   Contains("parameter 'mark' cannot be") && Contains("--allow-host"));
    CHECK_THAT(refusal(request({{"mark", "local:///run/other.sock"}}), open),
               Contains("reaches files or sockets of this host"));
    CHECK_THAT(refusal(request({{"mark", "://x"}}), open), Contains("is not a URL"));
}

TEST_CASE("the rules check each host of a database") {
    launch_rules open;
    open.target_hosts = {"10.0.0.7", "db.example:5432", "[::1]:5433"};
    for (const char* good : {"postgresql://atirma@10.0.0.7:5433,db.example/atirma?target_session_attrs=read-write",
                             "postgres://10.0.0.7,[::1]:5433,db.example:5432?sslmode=verify-full&sslrootcert=system"})
        CHECK(refusal(request({{"mark", good}}), open) == "it was allowed");
    for (const char* bad :
         {"postgresql://atirma@10.0.0.7,10.0.0.8/atirma", "postgresql://10.0.0.7,10.0.0.8:1,db.example",
          "postgresql://db.example,db.example:5433/x", "postgresql://10.0.0.7,[::1]/x"})
        CHECK_THAT(refusal(request({{"mark", bad}}), open), Contains("--allow-host"));
    for (const char* bad :
         {"postgresql://10.0.0.7,/x", "postgresql://,10.0.0.7/x", "postgresql://10.0.0.7/x?host=10.0.0.8",
          "postgresql://10.0.0.7/x?sslmode=require&hostaddr=10.0.0.8", "postgresql://10.0.0.7/x?port=22",
          "postgresql://10.0.0.7/x?ho%73t=10.0.0.8", "postgresql://10.0.0.7#@10.0.0.8/x", "postgresql://10.0.0.7#.x/y",
          "postgresql://10.0.0.7?x=@10.0.0.8/x", "postgresql://10.0.0.7 ,10.0.0.8/x", "postgresql:///x",
          "postgresql://10.0.0.7/x?service=other"})
        CHECK_THAT(refusal(request({{"mark", bad}}), open), Contains("is not a URL"));
}

TEST_CASE("the rules check each file that the URL of a database names") {
    auto parameter =
        GENERATE("passfile", "sslkey", "sslcert", "sslrootcert", "sslcrl", "sslcrldir", "sslkeylogfile", "servicefile");
    CAPTURE(parameter);
    auto with = [&](const std::string& value, std::vector<std::string> folders = {"/data", "/my files"}) {
        launch_rules rules;
        rules.target_hosts = {"10.0.0.7", "10.0.0.8"};
        rules.path_folders = std::move(folders);
        auto url = "postgresql://a@10.0.0.7,10.0.0.8/x?sslmode=verify-full&" + std::string(parameter) + "=" + value;
        return refusal(request({{"mark", url}}), rules);
    };
    for (const char* good : {"/data/x.pem", "%2fdata%2Fx.pem", "/my%20files/x", "/data/x.pem&connect_timeout=3", ""})
        CHECK(with(good) == "it was allowed");
    for (const char* bad : {"/etc/key.pem", "%2Fetc%2Fkey.pem", "/data/../etc/key.pem", "/data/%2e%2e/etc/key.pem",
                            "/data%2F..%2Fetc", "key.pem", "~/key.pem", "/database/x"})
        CHECK_THAT(with(bad),
                   Contains("in it is not allowed: it must be a path below /data or /my files (--allow-path)"));
    CHECK_THAT(with("/data/x&" + std::string(parameter) + "=/etc/x"), Contains("the file '/etc/x' in it"));
    CHECK_THAT(with("/data/x", {}), Contains("it allows none (--allow-path)"));
    for (const char* bad : {"/data/%zz", "/data/%", "/data/%2", "/data/x%00.pem", "/data/%+1"})
        CHECK_THAT(with(bad), Contains("is not one in a URL"));
}

TEST_CASE("endpoints are loopback unless the rules say otherwise") {
    auto with = [](std::vector<std::string> listen, launch_rules rules = {}) {
        auto asked = request();
        asked.listen = std::move(listen);
        return refusal(asked, rules);
    };
    CHECK(with({"tcp://127.0.0.1:7411", "tcp://[::1]:0", "local://@boat-1"}) == "it was allowed");
    CHECK_THAT(with({"tcp://0.0.0.0:0"}), Contains("127.0.0.1, ::1"));
    CHECK_THAT(with({"local:///etc/passwd"}), Contains("local://@name"));
    CHECK_THAT(with({"local://@a/../b"}), Contains("local://@name"));
    CHECK_THAT(with({"inproc://x"}), Contains("within its own process"));
    CHECK_THAT(with({"--help"}), Contains("is not an endpoint"));
    CHECK_THAT(with({"tls://127.0.0.1:0"}), Contains("tls takes certificates, and this instantiation server has none"));
    launch_rules certified;
    certified.has_certificates = true;
    CHECK(with({"tls://127.0.0.1:0"}, certified) == "it was allowed");
    CHECK_THAT(with({"tls://0.0.0.0:0"}, certified), Contains("127.0.0.1, ::1"));
    CHECK_THAT(with(std::vector<std::string>(9, "tcp://127.0.0.1:0")), Contains("9 endpoints"));
    launch_rules open;
    open.listen_addresses.push_back("0.0.0.0");
    CHECK(with({"tcp://0.0.0.0:0"}, open) == "it was allowed");
    auto asked = request();
    asked.protocol = "carrier pigeon";
    CHECK_THAT(refusal(asked), Contains("one of tcp, udp, tls, udp+tls, local"));
}

TEST_CASE("tls listens on an address that others know the host by, where one is allowed") {
    auto asked = request();
    asked.protocol = "tls";
    CHECK_THAT(refusal(asked), Contains("tls takes certificates"));
    auto listens = [&](std::vector<std::string> addresses) {
        launch_rules rules;
        rules.has_certificates = true;
        rules.listen_addresses.insert(rules.listen_addresses.end(), addresses.begin(), addresses.end());
        auto made = known().plan(asked, rules, 1);
        REQUIRE(made);
        return made->listen.at(0).text();
    };
    CHECK(listens({}) == "tls://127.0.0.1:0");
    CHECK(listens({"10.0.0.1"}) == "tls://10.0.0.1:0");
    CHECK(listens({"fd00::1"}) == "tls://[fd00::1]:0");
}

TEST_CASE("only variables that the type reads can be set") {
    auto asked = request();
    asked.variables = {{"LD_PRELOAD", "/tmp/x.so"}};
    CHECK_THAT(refusal(asked), Contains("only BOAT_NAME"));
    asked.variables = {{"BOAT_NAME", "a"}, {"BOAT_NAME", "b"}};
    CHECK_THAT(refusal(asked), Contains("given twice"));
    asked.type = "nameless";
    asked.path = "sea/x";
    asked.variables = {{"PATH", "/tmp"}};
    CHECK_THAT(refusal(asked), Contains("no environment variable"));
}

TEST_CASE("types and paths are named in what is refused") {
    auto asked = request();
    asked.type = "boot";
    CHECK(refusal(asked) == "there is no component type 'boot' here; did you mean 'boat'? there are boat, nameless");
    asked.type = "nameless";
    CHECK_THAT(refusal(asked), Contains("give one"));
    for (const char* bad : {"/sea", "sea/", "a//b", "a b", "--help=1", "ise/host/x", "ise"}) {
        asked.path = bad;
        CHECK(refusal(asked) != "it was allowed");
    }
}

TEST_CASE("a description that makes no sense is left out and told") {
    catalogue made;
    made.add("one", "hello");
    made.add(
        "two",
        R"({"types": [{"name": "../x"}, {"name": "good"}, {"name": "bad", "parameters": [{"name": "listen"}]}, {"name": "worse", "parameters": [{"name": "a"}, {"name": "a"}]}]})");
    made.add("three", R"({"types": [{"name": "good"}, {"name": "thief", "variables": ["ISE_NAME_SERVER"]}]})");
    auto result = made.tell();
    REQUIRE(result.types.size() == 1);
    CHECK(result.types.front().program == "two");
    auto all = std::accumulate(result.problems.begin(), result.problems.end(), std::string());
    CHECK(result.problems.size() == 6);
    CHECK_THAT(all, Contains("one: its answer to --describe") && Contains("cannot be called '../x'") &&
                        Contains("cannot be called 'listen'") && Contains("'good' is the one of two") &&
                        Contains("'ISE_NAME_SERVER' cannot be set by others"));
}

TEST_CASE("values are stored where they belong") {
    boat_values values;
    ise::parameter_set set;
    set.add("speed", values.speed, "");
    set.add("mode", values.mode, "");
    set.add("address", values.address, "").kind(ise::parameter_kind::hexadecimal);
    set.add("gusts", values.gusts, "");
    set.add("mark", values.marks, "");
    for (auto [name, value] : std::vector<std::pair<std::string, std::string>>{
             {"speed", "1.5"}, {"mode", "255"}, {"address", "ff"}, {"gusts", "false"}, {"mark", "a"}, {"mark", "b"}})
        CHECK(set.set(name, value));
    CHECK(values.speed == 1.5);
    CHECK(values.mode == 255);
    CHECK(values.address == 255);
    CHECK_FALSE(values.gusts);
    CHECK(values.marks == std::vector<std::string>{"a", "b"});
    CHECK_FALSE(set.set("speed", "2")); // twice
    CHECK_FALSE(set.set("depth", "2"));
    ise::parameter_set small;
    small.add("mode", values.mode, "");
    CHECK(small.set("mode", "256").error().message() ==
          "parameter 'mode' cannot be '256': it must be an integer from 0 to 255");
}

} // namespace catalogue_test
