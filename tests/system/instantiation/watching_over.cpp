// What an instantiation server does when something ends that should not, or does not end that should.
#include "host.hpp"

#include <unistd.h>

using namespace host_test;
using ise::instantiation::instance_state;
using ise_test::Contains;

TEST_CASE("a component that was killed is started again, by its policy") {
    host here;
    here.open();
    int first = here.start("sea/one", {"--restart", "on-failure"})["process_id"];
    int other = here.start("sea/two")["process_id"]; // never
    event_watch events(here);
    send_signal(first, SIGKILL);
    auto waiting = events.until("sea/one", instance_state::waiting);
    CHECK(waiting.reason == "signal 9 (Killed)");
    auto again = events.until("sea/one", instance_state::ready);
    CHECK(again.process_id != first);
    CHECK(again.restarts == 1);
    CHECK(here.json_of({"call", "sea/one", "ask", "--timeout", "60s"})["answer"] == 7);

    send_signal(other, SIGKILL);
    auto failed = events.until("sea/two", instance_state::failed);
    CHECK(failed.reason == "signal 9 (Killed)");
    CHECK(here.state("sea/two")["state"] == "failed");
}

TEST_CASE("a component that ends well is started again only if it is to run always") {
    host here;
    here.open();
    here.start("sea/one", {"--restart", "on-failure"});
    here.start("sea/two", {"--restart", "always"});
    here.ise({"call", "sea/one", "leave", "{}"});
    here.ise({"call", "sea/two", "leave", "{}"});
    wait_until([&] { return here.state("sea/one")["state"] == "stopped"; });
    CHECK(here.state("sea/one")["reason"] == "exit code 0");
    wait_until([&] {
        auto now = here.state("sea/two");
        return now["state"] == "ready" && now["restarts"] == 1;
    });
}

TEST_CASE("a component that ends again and again has failed in the end") {
    host here;
    here.open();
    here.start("sea/one", {"--restart", "always", "--restarts", "1"});
    for (int life = 0; life < 2; ++life) {
        here.ise({"--wait", "--timeout", "60s", "call", "sea/one", "leave", R"({"code": 4})"});
        wait_until([&] {
            auto now = here.state("sea/one");
            return now["state"] == "failed" || (now["state"] == "ready" && now["restarts"] == life + 1);
        });
    }
    auto now = here.state("sea/one");
    CHECK(now["state"] == "failed");
    CHECK_THAT(now["reason"].get<std::string>(),
               Contains("exit code 4") && Contains("started again 1 times within 60 s"));
    CHECK(here.start("sea/one")["state"] == "ready");
}

TEST_CASE("a stop goes to the whole group, and to what does not hear it") {
    host here;
    here.open();
    int pid = here.start("sea/one", {"--set", "children=4", "--grace", "300ms"})["process_id"];
    here.deafen("sea/one");
    CHECK(marked().size() == 5);
    auto ended = here.json_of({"stop", "sea/one"});
    CHECK(ended["state"] == "stopped");
    CHECK(ended["reason"] == "signal 9 (Killed)");
    CHECK_FALSE(lives(pid));
    wait_until([] { return marked().empty(); });
}

TEST_CASE("what a component has started ends with it, however that ends") {
    host here;
    here.open();
    int pid = here.start("sea/one", {"--set", "children=4"})["process_id"];
    CHECK(marked().size() == 5);
    send_signal(pid, SIGKILL);
    wait_until([] { return marked().empty(); });
    CHECK(here.state("sea/one")["state"] == "failed");
}

TEST_CASE("a component is restarted, and killed, when asked") {
    host here;
    here.open();
    int first = here.start("sea/one", {"--restart", "always", "--set", "answer=2"})["process_id"];
    auto again = here.json_of({"restart", "sea/one", "--timeout", "120s"});
    CHECK(again["state"] == "ready");
    CHECK(again["process_id"] != first);
    CHECK_FALSE(lives(first));
    CHECK(here.json_of({"call", "sea/one", "ask"})["answer"] == 2);
    auto killed = here.json_of({"kill", "sea/one"});
    CHECK(killed["state"] == "stopped");
    CHECK(killed["reason"] == "signal 9 (Killed)");
    CHECK(here.json_of({"restart", "sea/one", "--timeout", "120s"})["state"] == "ready"); // also one that is over
    CHECK_THAT(here.ise({"stop", "sea/won"}).err,
               Contains("no instantiation server has started 'sea/won'") && Contains("did you mean 'sea/one'"));
}

TEST_CASE("what is printed can be read, followed, and does not fill the disk") {
    host here;
    here.open();
    here.start("sea/one", {"--set", "say=first"});
    ise_test::program follow({"ise", "--name-server", here.name_server(), "logs", "sea/one", "--follow"});
    auto read_until = [&](const std::string& wanted) { // the program says other things, too
        for (;;) {
            auto line = follow.read_line();
            REQUIRE(!line.empty());
            if (line == wanted) break;
        }
    };
    read_until("first");
    here.ise({"call", "sea/one", "say", R"({"text": "second"})"});
    read_until("second");
    here.ise({"call", "sea/one", "say", R"({"text": "abcdefghijklmnopqrstuvwxyz", "times": 60000})", "--timeout",
              "60s"}); // 1.6 MB
    wait_until([&] {   // what is printed in the moment in which the file is moved may be lost
        here.ise({"call", "sea/one", "say", R"({"text": "last"})"});
        return here.ise({"logs", "sea/one", "-n", "1"}).out == "last\n";
    });
    auto bounded = [&] {
        std::uintmax_t bytes = 0;
        for (const auto& entry : std::filesystem::directory_iterator(here.state_folder()))
            if (entry.path().filename().string().starts_with("sea+one.log") && entry.path().extension() == ".log")
                bytes += entry.file_size();
        return bytes <= (256 << 10);
    };
    wait_until(bounded);
    CHECK(here.ise({"logs", "sea/one"}).out.size() > 1000);
    follow.signal(SIGINT);
    CHECK(follow.wait().exit_code == 0);
}
