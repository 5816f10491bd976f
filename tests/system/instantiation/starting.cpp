// Starting components through the command line: what succeeds, and what is refused with which words.
#include "host.hpp"

#include <ise/core/readable.hpp>
#include <ise/service/service_host.hpp>

#include <fstream>
#include <sstream>
#include <sys/mount.h>
#include <test_folders.hpp>
#include <unistd.h>

using namespace host_test;
using ise_test::Contains;

TEST_CASE("a component is started and found and called and stopped") {
    host here;
    here.open();
    auto result = here.start("sea/one", {"--set", "answer=3.5", "--env", "TROUBLE_FLAG=up"});
    CHECK(result["state"] == "ready");
    CHECK(result["host"] == "shore");
    CHECK(result["type"] == "trouble");
    int pid = result["process_id"];
    REQUIRE(pid > 1);
    CHECK(lives(pid));
    CHECK(here.json_of({"call", "sea/one", "ask"}) == json{{"answer", 3.5}, {"variable", "up"}});
    auto listed = here.ise({"ps"});
    CHECK_THAT(listed.out, Contains("sea/one") && Contains("ready") && Contains(std::to_string(pid)));
    CHECK(here.ise({"ps", "--names"}).out == "sea/one\n");

    auto ended = here.json_of({"stop", "sea/one"});
    CHECK(ended["state"] == "stopped");
    CHECK(ended["process_id"] == 0);
    CHECK_FALSE(lives(pid));
    CHECK(marked().empty());
    CHECK(here.close() == 0);
}

TEST_CASE("the types that can be started are told with their parameters") {
    host here;
    here.install("atirma");
    here.open();
    CHECK(here.ise({"start", "--types", "--names"}).out == "boat-simulator\ncommunication-node\nfoxglove-boat\ngprs-"
                                                           "gateway\ngprs-link\ngprs-proxy\niridium-gateway\niridium-"
                                                           "modem\niridium-proxy\n"
                                                           "nmea-bridge\ntrouble\nweb-server\nxbee-link\nxbee-proxy\n");
    auto page = here.ise({"start", "--types", "boat-simulator"});
    CHECK_THAT(page.out, Contains("a boat that sails") && Contains("wind-speed") &&
                             Contains("a number from 0 to 40 (m/s)") && Contains("one of T1, T2, none") &&
                             Contains("ground_truth"));
    CHECK_THAT(here.ise({"start", "--types", "communication-node"}).out,
               Contains("requires") && Contains("telecommand_recall"));
    for (const auto* proxy : {"gprs-proxy", "iridium-proxy"})
        CHECK_THAT(here.ise({"start", "--types", proxy}).out, Contains("requires") && Contains("telemetry_store"));
    auto boat = here.json_of({"start", "boat-simulator", "--set", "wind-speed=9", "--namespace", "test", "--timeout",
                              "120s", "--ready-within", "60s"});
    CHECK(boat["path"] == "test/atirma/boat");
    CHECK(here.ise({"describe", "--names", "test/atirma/boat"}).out == "scene\nground_truth\n");
}

TEST_CASE("what the server's environment says of traces and of recorded calls holds for what it starts") {
    host here;
    const auto spans = here.programs().parent_path() / "spans.jsonl";
    ::setenv("ISE_TRACES", std::filesystem::relative(spans).c_str(), 1);
    ::setenv("ISE_RECORD_CALLS", "1", 1);
    here.open();
    ::unsetenv("ISE_TRACES");
    ::unsetenv("ISE_RECORD_CALLS");
    here.start("sea/one", {"--set", "answer=3.5"});
    here.json_of({"call", "sea/one", "ask"});
    CHECK_THAT(here.ise({"describe", "--all", "sea/one"}).out, Contains("ise.calls"));
    here.json_of({"stop", "sea/one"}); // it writes its last spans
    std::ifstream file(spans);
    CHECK_THAT(std::string(std::istreambuf_iterator<char>(file), {}), Contains("sea/one"));
    CHECK(here.close() == 0);
}

TEST_CASE("a program that is installed while the server runs can be started") {
    host here;
    here.open();
    here.install("atirma");
    CHECK_THAT(here.ise({"start", "--types", "--names"}).out, Contains("boat-simulator"));
}

TEST_CASE("programs that are none are told and do no harm") {
    host here;
    auto put = [&](const std::string& name, const std::string& text) {
        auto file = here.programs() / name;
        std::ofstream(file) << "#!/bin/sh\n" << text << "\n";
        std::filesystem::permissions(file, std::filesystem::perms::owner_all);
    };
    put("babbler", "yes | head -c 3000000");
    put("failing", "echo no; exit 3");
    put("liar", "echo '{\"types\": [{\"name\": \"--trouble\"}]}'");
    put("nonsense", "echo hello");
    put("thief", "echo '{\"program\":\"thief\",\"types\": [{\"name\": \"other\", \"variables\": [\"LD_PRELOAD\"]}]}'");
    here.open();
    auto result = here.ise({"start", "--types", "--names"});
    CHECK(result.out == "trouble\n");
    auto loud = here.ise({"start", "--types"});
    CHECK_THAT(loud.err, Contains("babbler --describe: it says more than") && Contains("exit code 3") &&
                             Contains("a type cannot be called '--trouble'") &&
                             Contains("nonsense: its answer to --describe") &&
                             Contains("'LD_PRELOAD' cannot be set by others"));
    CHECK(marked().empty());
}

TEST_CASE("what is not allowed is refused with what is") {
    host here;
    here.open();
    auto refused = [&](std::vector<std::string> words) {
        words.insert(words.begin(), "start");
        auto ran = here.ise(std::move(words));
        CHECK(ran.exit_code == 2);
        CHECK(ran.out.empty());
        return ran.err;
    };
    CHECK_THAT(refused({"truble"}),
               Contains("there is no component type 'truble' here; did you mean 'trouble'? there are trouble"));
    CHECK_THAT(refused({"../ise_trouble"}), Contains("there is no component type"));
    CHECK_THAT(refused({"trouble", "--set", "answer=11"}),
               Contains("parameter 'answer' cannot be '11': it must be a number from 0 to 10 (m)"));
    CHECK_THAT(refused({"trouble", "--set", "answer=3 --deaf=true"}), Contains("cannot be '3 --deaf=true'"));
    CHECK_THAT(refused({"trouble", "--set", "answer"}), Contains("--set takes NAME=VALUE"));
    CHECK_THAT(refused({"trouble", "--set", "speed=1"}), Contains("has no parameter 'speed'; it has answer, children"));
    CHECK_THAT(refused({"trouble", "--set", "name-server=tcp://127.0.0.1:1"}),
               Contains("has no parameter 'name-server'"));
    CHECK_THAT(refused({"trouble", "--set", "answer=1", "--set", "answer=2"}), Contains("given twice"));
    CHECK_THAT(refused({"trouble", "--set", "file=/etc/passwd"}), Contains("it must be a path below"));
    CHECK_THAT(refused({"trouble", "sea//one"}), Contains("is not a path of a component"));
    CHECK_THAT(refused({"trouble", "ise/name_server"}), Contains("kept for ISE itself"));
    CHECK_THAT(refused({"trouble", "--listen", "tcp://0.0.0.0:0"}),
               Contains("the addresses that this instantiation server allows are 127.0.0.1, ::1"));
    CHECK_THAT(refused({"trouble", "--listen", "local:///tmp/anywhere"}), Contains("local://@name"));
    CHECK_THAT(refused({"trouble", "--env", "LD_PRELOAD=/tmp/x.so"}), Contains("only TROUBLE_FLAG"));
    CHECK_THAT(refused({"trouble", "--restarts", "5000"}), Contains("--restarts"));
    CHECK(here.ise({"ps", "--names"}).out.empty());
    CHECK(marked().empty());
}

TEST_CASE("text that looks like an option stays the value that it is") {
    host here;
    here.open();
    here.start("sea/one", {"--set", "say=--path=sea/other", "--set", "word=--help", "--set", "word=$(reboot); -x"});
    CHECK(here.ise({"logs", "sea/one"}).out.find("--path=sea/other\n") != std::string::npos);
    CHECK(here.ise({"list", "--names", "sea"}).out == "sea/one\n");
}

TEST_CASE("a path parameter is allowed in the folders that the server was told") {
    host here;
    here.open({"--allow-path", "/dev/null", "--allow-path", "/tmp"});
    here.start("sea/one", {"--set", "file=/dev/null"});
    here.start("sea/two", {"--set", "file=/tmp/x/y"});
    CHECK_THAT(here.ise({"start", "trouble", "sea/three", "--set", "file=/tmp/../etc/passwd"}).err,
               Contains("it must be a path below /dev/null or /tmp"));
    CHECK_THAT(here.ise({"start", "trouble", "sea/three", "--set", "file=/tmpfile"}).err,
               Contains("it must be a path below"));
}

TEST_CASE("parameters listen and connect only where the server allows") {
    host here;
    here.install("atirma");
    here.open({"--allow-host", "gateway.example"});
    auto refused = [&](const std::string& type, const std::string& setting) {
        INFO(type << " " << setting);
        auto ran = here.ise({"start", type, "--set", setting});
        CHECK(ran.exit_code == 2);
        return ran.err;
    };
    for (auto [type, setting] :
         std::vector<std::pair<std::string, std::string>>{{"web-server", "address=0.0.0.0"},
                                                          {"gprs-proxy", "boat-listen=tcp://0.0.0.0:0"},
                                                          {"gprs-link", "boat-listen=udp://[::]:0"},
                                                          {"iridium-proxy", "webhook=tcp://0.0.0.0:8080"},
                                                          {"iridium-proxy", "directip=tcp://0.0.0.0:10800"},
                                                          {"iridium-gateway", "listen-http=tcp://0.0.0.0:0"},
                                                          {"iridium-gateway", "listen-directip=tcp://0.0.0.0:0"},
                                                          {"nmea-bridge", "nmea-tcp=tcp://0.0.0.0:0"},
                                                          {"nmea-bridge", "signalk-tcp=tcp://0.0.0.0:0"}})
        CHECK_THAT(refused(type, setting), Contains("--allow-address"));
    for (auto [type, setting] :
         std::vector<std::pair<std::string, std::string>>{{"gprs-link", "proxy-tcp=tcp://127.0.0.1:22"},
                                                          {"gprs-link", "proxy-udp=udp://127.0.0.1:53"},
                                                          {"boat-simulator", "gprs=tcp://127.0.0.1:22"},
                                                          {"iridium-proxy", "url=http://169.254.169.254/latest/"},
                                                          {"iridium-proxy", "url=http://gateway.example.evil.example/"},
                                                          {"iridium-proxy", "send-directip=tcp://127.0.0.1:22"},
                                                          {"iridium-proxy", "imap=imap://127.0.0.1"},
                                                          {"iridium-proxy", "smtp=smtp://127.0.0.1"},
                                                          {"iridium-gateway", "post-to=http://127.0.0.1:8080/"},
                                                          {"iridium-gateway", "directip-to=tcp://127.0.0.1:22"},
                                                          {"nmea-bridge", "nmea-udp=udp://255.255.255.255:10110"},
                                                          {"nmea-bridge", "signalk-udp=udp://127.0.0.1:53"},
                                                          {"nmea-bridge", "telemetry=tcp://127.0.0.1:22"},
                                                          {"web-server", "more-boats=Vela=tcp://127.0.0.1:22"},
                                                          {"communication-node", "proxy=xbee=tcp://127.0.0.1:22"}})
        CHECK_THAT(refused(type, setting), Contains("--allow-host"));
    CHECK(marked().empty());
    here.start("sea/allowed", {"--set", "outlet=tcp://127.0.0.1:0", "--set", "word=https://gateway.example/"});
}

TEST_CASE("what a parameter of A-Tirma says of itself fits its kind") {
    host here;
    here.install("atirma");
    here.open();
    std::size_t places = 0;
    for (const auto& type : here.json_of({"start", "--types"}))
        for (const auto& one : type["parameters"]) {
            auto kind = one["kind"].get<std::string>();
            auto text = one["description"].get<std::string>() + " " + one["preset"].get<std::string>();
            INFO(type["type"] << " " << one["name"] << ": " << text);
            bool place = text.find("://") != text.npos || text.find("URL") != text.npos ||
                         text.find("to listen on") != text.npos;
            bool port = one["name"] == "port"; // a number, beside an address
            CHECK((!place || port || kind == "endpoint" || kind == "address" || kind == "url"));
            places += kind == "endpoint" || kind == "address" || kind == "url";
        }
    CHECK(places >= 18);
}

TEST_CASE("folders of other users are refused") {
    if (::geteuid() != 0) return ise_test::skip("giving a folder to another user takes root");
    host here;
    auto his = here.programs().parent_path() / "his";
    std::filesystem::create_directory(his);
    REQUIRE(::chown(his.c_str(), 54321, 54321) == 0);
    auto run = [&](const std::string& programs, const std::string& state) {
        return ise_test::run_program({"ise_instantiation_server", "--programs", programs, "--state", state, "--name",
                                      "other", "--name-server", here.name_server()});
    };
    auto programs = run(his.string(), here.state_folder().string());
    CHECK(programs.exit_code == 1);
    CHECK_THAT(programs.err, Contains("his is not safe from other users") && Contains("belongs to user 54321"));
    auto state = run(here.programs().string(), (his / "state").string());
    CHECK(state.exit_code == 1);
    CHECK_THAT(state.err, Contains("is not safe from other users"));
    std::filesystem::copy_file(ISE_BINARY_DIR "/bin/ise_trouble", here.programs() / "stolen");
    REQUIRE(::chown((here.programs() / "stolen").c_str(), 54321, 54321) == 0);
    here.open();
    CHECK_THAT(here.ise({"start", "--types"}).err, Contains("stolen: ") && Contains("belongs to user 54321"));
}

TEST_CASE("a component that fails before it is ready is told with its reason and its last words") {
    host here;
    here.open();
    auto ran = here.ise({"start", "trouble", "sea/one", "--set", "failing=the rudder is missing", "--set",
                         "say=hoisting", "--restart", "always"});
    CHECK(ran.exit_code == 1);
    CHECK_THAT(ran.err, Contains("'sea/one' did not start: it ended before it was ready: exit code 1") &&
                            Contains("hoisting") && Contains("the rudder is missing"));
    CHECK(here.state("sea/one")["state"] == "failed");
    CHECK(marked().empty());
    CHECK(here.start("sea/one")["state"] == "ready"); // the failed one is no obstacle
}

TEST_CASE("a component that does not become ready in time is ended and told") {
    host here;
    here.open();
    auto ran = here.ise({"start", "trouble", "sea/one", "--set", "silent=true", "--ready-within", "700ms"});
    CHECK(ran.exit_code == 3);
    CHECK_THAT(ran.err, Contains("it was not ready within 0.7 s") && Contains("the name server does not know it yet"));
    CHECK(marked().empty());
}

TEST_CASE("an address that is in use and a name that is taken are told before anything starts") {
    host here;
    here.open();
    ise::real_environment env;
    ise::node_options options;
    options.name_servers = {ise::endpoint::parse(here.name_server()).value()};
    options.log = {};
    ise::node node(env, options);
    auto& other = node.start("sea/taken", [](ise::component&) -> ise::task<> { co_return; });
    other.wait(other.ready());
    std::string occupied;
    for (const auto& at : other.services().listening())
        if (at.kind == ise::protocol::tcp) occupied = at.text();

    auto address = here.ise({"start", "trouble", "sea/one", "--listen", occupied});
    CHECK(address.exit_code == 1);
    CHECK_THAT(address.err, Contains("cannot listen on " + occupied));
    auto by_port = here.ise({"start", "trouble", "sea/one", "--set", "page=127.0.0.1", "--set",
                             "page-port=" + occupied.substr(occupied.rfind(':') + 1)});
    CHECK(by_port.exit_code == 1);
    CHECK_THAT(by_port.err, Contains("cannot listen on " + occupied));
    CHECK(marked().empty());
    auto name = here.ise({"start", "trouble", "sea/taken"});
    CHECK(name.exit_code == 1);
    CHECK_THAT(name.err, Contains("'sea/taken' is held by process") && Contains("which was not started here"));
    here.start("sea/one");
    CHECK_THAT(here.ise({"start", "trouble", "sea/one"}).err, Contains("'sea/one' runs here already, as process"));
}

TEST_CASE("a program that is gone is told, and leaves nothing behind") {
    host here;
    here.open();
    std::filesystem::remove(here.programs() / "ise_trouble");
    std::ofstream(here.programs() / "ise_trouble") << "no program";
    std::filesystem::permissions(here.programs() / "ise_trouble", std::filesystem::perms::owner_all);
    auto ran = here.ise({"start", "trouble", "sea/one"});
    CHECK(ran.exit_code == 1);
    CHECK_THAT(ran.err, Contains("cannot start") && Contains("ise_trouble"));
    CHECK(here.state("sea/one")["state"] == "failed");
    CHECK(zombies() == 0);
}

TEST_CASE("the tables of instances, parameters and types fit on a terminal of 80 columns") {
    host here;
    here.install("atirma");
    here.open();
    here.start("sea/one/with/a/path/that/is/quite/long", {"--set", "word=" + std::string(100, 'w')});
    here.ise({"start", "trouble", "sea/two", "--set",
              "failing=the rudder is missing, and so is the mast, the keel and most of the crew"});
    for (const char* command :
         {"ps", "param list sea/one/with/a/path/that/is/quite/long", "start --types", "start --types iridium-proxy"}) {
        auto line = "stty cols 80 rows 24; " ISE_BINARY_DIR "/bin/ise --timeout 60s --name-server " +
                    here.name_server() + " " + command;
        auto ran = ise_test::run_program({"/usr/bin/script", "-qec", line, "/dev/null"});
        INFO(ran.out);
        CHECK(ran.exit_code == 0);
        std::istringstream text(ran.out);
        std::size_t lines = 0;
        for (std::string one; std::getline(text, one); ++lines) {
            if (one.ends_with('\r')) one.pop_back();
            CHECK(ise::columns(one) <= 80);
        }
        CHECK(lines >= 3);
    }
}

TEST_CASE("no more instances run than the server was told") {
    host here;
    here.open({"--max-instances", "2"});
    here.start("sea/one");
    here.start("sea/two");
    auto third = here.ise({"start", "trouble", "sea/three"});
    CHECK(third.exit_code == 1);
    CHECK_THAT(third.err, Contains("2 instances run here, which is the limit"));
    here.json_of({"stop", "sea/one"});
    CHECK(here.start("sea/three")["state"] == "ready");
    CHECK(here.ise({"ps", "--names"}).out == "sea/three\nsea/two\n");
}

TEST_CASE("whoever gives up a start ends what it began") {
    host here;
    here.open();
    ise_test::program starting({"ise", "--name-server", here.name_server(), "start", "trouble", "sea/one", "--set",
                                "silent=true", "--ready-within", "60s"});
    wait_until([] { return !marked().empty(); });
    starting.signal(SIGINT);
    CHECK(starting.wait().exit_code == 130);
    wait_until([] { return marked().empty(); });
    wait_until([&] { return here.state("sea/one")["state"] == "stopped"; });
}

TEST_CASE("the shell completes types and instances by asking for them") {
    host here;
    here.open();
    here.start("sea/one");
    ise_test::start_options options;
    options.variables = {{"ISE_NAME_SERVER", here.name_server()}};
    auto offered = [&](const std::string& line) {
        auto script =
            R"(source <("$1" completion bash); COMP_LINE="$1 $2"; COMP_POINT=${#COMP_LINE}; _ise; echo "${COMPREPLY[*]}")";
        return ise_test::run_program({"/bin/bash", "-c", script, "bash", ISE_BINARY_DIR "/bin/ise", line}, options).out;
    };
    CHECK(offered("start tr") == "trouble\n");
    CHECK(offered("stop ") == "sea/one\n");
    CHECK(offered("logs --lines 3 sea") == "sea/one\n");
    CHECK_THAT(offered("start --"), Contains("--set") && Contains("--restart"));
}

TEST_CASE("what cannot be written down is not started") {
    host here;
    std::filesystem::create_directories(here.state_folder());
    if (::mount("none", here.state_folder().c_str(), "tmpfs", 0, "size=1m,mode=0700") != 0) {
        WARN("skipped: a full disk takes root");
        return;
    }
    struct mounted { // nothing of it may run any more
        host& of;
        ~mounted() {
            of.close();
            ::umount2(of.state_folder().c_str(), MNT_DETACH);
        }
    } guard{here};
    auto filling = here.state_folder() / "filling";
    std::ofstream(filling) << std::string(2'000'000, 'x'); // before the server can keep room for its state
    here.open();
    auto refused = here.ise({"start", "trouble", "sea/two", "--timeout", "120s"});
    CHECK(refused.exit_code == 1);
    CHECK_THAT(refused.err, Contains("it could not be written down") && Contains("No space left on device"));
    std::filesystem::remove(filling);
    CHECK(here.start("sea/two")["state"] == "ready");
}
