// Instantiation servers that come and go: what was started is never lost.
#include "host.hpp"

#include <algorithm>
#include <fstream>
#include <unistd.h>

using namespace host_test;
using ise_test::Contains;

TEST_CASE("what an instantiation server had started goes on when it is killed, and is taken over by the next") {
    host here;
    here.open();
    int pid = here.start("sea/one", {"--set", "answer=2"})["process_id"];
    here.crash();
    CHECK(lives(pid));
    CHECK(here.json_of({"call", "sea/one", "ask"})["answer"] == 2);
    here.open();
    auto shown = here.state("sea/one");
    CHECK(shown["state"] == "ready");
    CHECK(shown["process_id"] == pid);
    CHECK(shown["adopted"] == true);
    auto ended = here.json_of({"stop", "sea/one"});
    CHECK(ended["state"] == "stopped");
    CHECK_FALSE(lives(pid));
}

TEST_CASE("the doctor finds an instantiation server that was killed, until it is back, and none that was stopped") {
    host here;
    here.open();
    here.start("sea/one");
    auto lost = [&] {
        auto ran = here.ise({"doctor", "--json", "--interval", "100ms"});
        auto parsed = json::parse(ran.out);
        for (const auto& one : parsed["findings"])
            if (one["kind"] == "server_lost") {
                CHECK(ran.exit_code == 1);
                CHECK_THAT(one["component"].get<std::string>(), ise_test::StartsWith("ise/host/"));
                CHECK_THAT(one["message"].get<std::string>(),
                           Contains("was lost") && Contains("without being stopped (process "));
                CHECK_THAT(one["advice"].get<std::string>(), Contains("start it again with the same --state"));
                return true;
            }
        return false;
    };
    CHECK_FALSE(lost());
    here.crash();
    wait_until(lost); // when its lease is over
    here.open();
    CHECK_FALSE(lost());
    CHECK(here.close() == 0);
    CHECK_FALSE(lost());
}

TEST_CASE("what was taken over is watched over as before") {
    host here;
    here.open();
    int pid = here.start("sea/one", {"--restart", "on-failure"})["process_id"];
    here.crash();
    here.open();
    send_signal(pid, SIGKILL);
    wait_until([&] {
        auto shown = here.state("sea/one");
        return shown["state"] == "ready" && shown["process_id"] != pid;
    });
    CHECK(here.state("sea/one")["restarts"] == 1);
}

TEST_CASE("what ended while no instantiation server ran follows its policy, and leaves nothing behind") {
    host here;
    here.open();
    int again = here.start("sea/again", {"--restart", "always", "--set", "children=2"})["process_id"];
    int never = here.start("sea/never", {"--set", "children=2"})["process_id"];
    CHECK(marked().size() == 6);
    const int keepers[] = {keeper_of(again), keeper_of(never)};
    here.crash();
    send_signal(again, SIGKILL);
    send_signal(never, SIGKILL);
    wait_until([&] { return marked().empty() && std::ranges::none_of(keepers, lives); }); // also their children
    here.open();
    wait_until([&] { return here.state("sea/again")["state"] == "ready"; });
    auto shown = here.state("sea/never");
    CHECK(shown["state"] == "failed");
    CHECK_THAT(shown["reason"].get<std::string>(),
               ise_test::StartsWith("it ended while no instantiation server ran: signal 9 (Killed)"));
    CHECK(marked().size() == 3); // those of the new life
}

TEST_CASE("how a component ended that was taken over is known") {
    host here;
    here.open();
    int well = here.start("sea/well", {"--restart", "on-failure"})["process_id"];
    here.start("sea/badly");
    int killed = here.start("sea/killed")["process_id"];
    int shared = here.start("sea/shared", {"--process", "main"})["process_id"];
    here.crash();
    here.open();
    send_signal(well, SIGTERM);
    here.json_of({"call", "sea/badly", "fail", R"({"text": "no wind"})"});
    send_signal(killed, SIGKILL);
    send_signal(shared, SIGTERM);
    for (const char* path : {"sea/well", "sea/badly", "sea/killed", "sea/shared"})
        wait_until([&] { return here.state(path)["process_id"] == 0; });
    auto what = [&](const char* path) {
        return here.state(path)["state"].get<std::string>() + ": " + here.state(path)["reason"].get<std::string>();
    };
    CHECK(what("sea/well") == "stopped: exit code 0");
    CHECK(what("sea/badly") == "failed: exit code 1");
    CHECK_THAT(what("sea/killed"), ise_test::StartsWith("failed: signal 9 (Killed)"));
    CHECK(what("sea/shared") == "stopped: its process 'main' ended: exit code 0");
}

TEST_CASE("how a component ended while no instantiation server ran is recorded") {
    host here;
    here.open();
    int well = here.start("sea/well", {"--restart", "on-failure"})["process_id"];
    int badly = here.start("sea/badly")["process_id"];
    int shared = here.start("sea/shared", {"--process", "main"})["process_id"];
    const int keepers[] = {keeper_of(well), keeper_of(badly), keeper_of(shared)};
    here.crash();
    send_signal(well, SIGTERM);
    send_signal(shared, SIGTERM);
    here.json_of({"call", "sea/badly", "fail", R"({"text": "no wind"})"});
    wait_until([&] { return std::ranges::none_of(keepers, lives); });
    here.open();
    auto what = [&](const char* path) {
        return here.state(path)["state"].get<std::string>() + ": " + here.state(path)["reason"].get<std::string>();
    };
    CHECK(what("sea/well") == "stopped: it ended while no instantiation server ran: exit code 0");
    CHECK(what("sea/badly") == "failed: it ended while no instantiation server ran: exit code 1");
    CHECK(what("sea/shared") == "stopped: it ended while no instantiation server ran: exit code 0");
}

TEST_CASE("a process that was started but not written down yet is found by its mark") {
    host here;
    here.open();
    int pid = here.start("sea/one", {"--set", "answer=2"})["process_id"];
    here.crash();
    auto file = here.state_folder() / "state.json";
    json state;
    std::ifstream(file) >> state;
    state["instances"][0]["process"] = {{"pid", 0}, {"start_ticks", 0}};
    state["instances"][0]["state"] = "starting";
    std::ofstream(file) << state;
    here.open();
    wait_until([&] { return here.state("sea/one")["state"] == "ready"; });
    CHECK(here.state("sea/one")["process_id"] == pid);
}

TEST_CASE("another process that has got the number is left alone") {
    host here;
    here.open();
    int pid = here.start("sea/one")["process_id"];
    here.crash();
    auto file = here.state_folder() / "state.json";
    json state;
    std::ifstream(file) >> state;
    auto& process = state["instances"][0]["process"];
    process["pid"] = ::getpid(); // this test
    state["instances"][0]["mark"] = "0123456789abcdef";
    std::ofstream(file) << state;
    here.open();
    CHECK(here.state("sea/one")["state"] == "failed");
    CHECK(lives(pid));
}

TEST_CASE("a state that cannot be read is put aside and told") {
    host here;
    std::filesystem::create_directories(here.state_folder());
    std::ofstream(here.state_folder() / "state.json") << "{\"instances\": [";
    here.open();
    CHECK(here.ise({"ps", "--names"}).out.empty());
    CHECK(std::filesystem::exists(here.state_folder() / "state.json.unreadable"));
}

TEST_CASE("an instantiation server that is asked to end ends all that it has started") {
    host here;
    here.open({"--grace", "300ms"});
    here.start("sea/one", {"--set", "children=2", "--restart", "always"});
    here.start("sea/two");
    here.deafen("sea/two");
    CHECK(here.close() == 0);
    CHECK(marked().empty());
    here.open();
    CHECK(here.ise({"ps", "--names"}).out.empty());
}

TEST_CASE("an instantiation server can leave what runs to the next one") {
    host here;
    here.open({"--leave-running"});
    int pid = here.start("sea/one")["process_id"];
    CHECK(here.close() == 0);
    CHECK(lives(pid));
    here.open();
    CHECK(here.state("sea/one")["process_id"] == pid);
}

TEST_CASE("an instantiation server that is asked to end before it took over what runs leaves it to the next one") {
    host here;
    here.open();
    int pid = here.start("sea/one")["process_id"];
    here.crash();
    const auto slow = here.programs() / "slow";
    std::ofstream(slow) << "#!/bin/sh\nexec sleep 60\n"; // its --describe is waited for
    std::filesystem::permissions(slow, std::filesystem::perms::owner_all);
    here.boot();
    CHECK(here.close() == 0);
    CHECK(lives(pid));
    std::filesystem::remove(slow);
    here.open();
    CHECK(here.state("sea/one")["process_id"] == pid);
}

TEST_CASE("an instantiation server refuses what would make it unsafe") {
    host here;
    auto refused = [&](std::vector<std::string> options, std::string programs = {}, std::string state = {}) {
        if (programs.empty()) programs = here.programs().string();
        if (state.empty()) state = here.state_folder().string();
        std::vector<std::string> words{
            "ise_instantiation_server", "--programs", programs, "--state", state, "--name-server", here.name_server()};
        words.insert(words.end(), options.begin(), options.end());
        auto ran = ise_test::run_program(words);
        CHECK(ran.exit_code == 1);
        return ran.err;
    };
    CHECK_THAT(refused({"--listen", "tcp://0.0.0.0:0"}),
               Contains("an instantiation server starts programs") &&
                   Contains("nobody may listen on tcp://0.0.0.0:0 without credentials") && Contains("--key"));
    CHECK_THAT(refused({}, "/nowhere/at/all"), Contains("cannot read the folder /nowhere/at/all"));
    here.open();
    CHECK_THAT(refused({}), Contains("another instantiation server uses the folder"));
    CHECK_THAT(refused({"--name", "shore"}, {}, (here.state_folder() / "more").string()), Contains("'ise/host/shore'"));
}
