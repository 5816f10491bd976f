// Components that share a process, each on a thread of its own.
#include "host.hpp"

#include <signal.h>

using namespace host_test;
using ise_test::Contains;

namespace {

struct shared_host : host {
    shared_host() { open(); }

    /// A `trouble` in the process "main": what is told of it.
    json share(const std::string& path, std::vector<std::string> more = {}) {
        more.insert(more.begin(), {"--process", "main"});
        return start(path, std::move(more));
    }
    int pid(const std::string& path) { return state(path)["process_id"]; }
    bool is(const std::string& path, const std::string& wanted) { return state(path)["state"] == wanted; }
    /// In a process other than its former one.
    bool is_ready_again(const std::string& path, int former) {
        auto now = state(path);
        return now["state"] == "ready" && now["process_id"] != former;
    }
    json answer(const std::string& path) { return json_of({"call", path, "ask"})["answer"]; }
};

} // namespace

TEST_CASE("the last component of a shared process that is stopped is not told to leave others behind") {
    shared_host here;
    here.share("sea/one");
    here.share("sea/two");
    for (const char* path : {"sea/one", "sea/two"})
        CHECK(here.json_of({"stop", path})["reason"] == "ended without a failure, in process 'main'");
}

TEST_CASE("components share a process, and each is driven for itself") {
    shared_host here;
    int pid = here.share("sea/one", {"--set", "answer=1", "--set", "say=one is here"})["process_id"];
    auto second = here.share("sea/two", {"--set", "answer=2", "--set", "say=two is here"});
    CHECK(second["process_id"] == pid);
    CHECK(second["process"] == "main");
    CHECK(here.start("sea/alone")["process_id"] != pid);
    CHECK(here.answer("sea/one") == 1); // parameters of the same type, but not the same variables
    CHECK(here.answer("sea/two") == 2);
    here.json_of({"param", "set", "sea/one", "answer", "5"});
    CHECK(here.answer("sea/one") == 5);
    CHECK(here.answer("sea/two") == 2);
    CHECK_THAT(here.ise({"ps"}).out, Contains(std::to_string(pid) + " (main)"));
    for (const char* path : {"sea/one", "sea/two"})
        CHECK_THAT(here.ise({"logs", path}).out, Contains("one is here") && Contains("two is here"));

    here.json_of({"restart", "sea/one"});
    CHECK(here.pid("sea/one") == pid);
    CHECK(here.answer("sea/one") == 5); // what was set holds in the next life
    auto stopped = here.json_of({"stop", "sea/one"});
    CHECK(stopped["state"] == "stopped");
    CHECK(here.ise({"describe", "sea/one"}).exit_code == 3);
    CHECK(here.answer("sea/two") == 2);
    CHECK(lives(pid));
    CHECK(here.json_of({"kill", "sea/two"})["state"] == "stopped"); // the last: its process goes with it
    CHECK_FALSE(lives(pid));
    CHECK_THAT(here.ise({"logs", "sea/two"}).out, Contains("two is here"));
    CHECK(here.share("sea/two")["state"] == "ready");
    CHECK(here.close() == 0);
    CHECK(marked().empty());
}

TEST_CASE("when a shared process is lost, all that ran in it goes on by its own policy") {
    shared_host here;
    int pid = here.share("sea/one", {"--restart", "on-failure"})["process_id"];
    here.share("sea/two", {"--restart", "always"});
    here.share("sea/three");
    send_signal(pid, SIGKILL);
    wait_until([&] {
        return here.is_ready_again("sea/one", pid) && here.is_ready_again("sea/two", pid) &&
               here.is("sea/three", "failed");
    });
    CHECK(here.pid("sea/one") == here.pid("sea/two"));
    for (const char* path : {"sea/one", "sea/two"}) CHECK(here.state(path)["restarts"] == 1);
    CHECK_THAT(here.state("sea/three")["reason"].get<std::string>(), Contains("its process 'main' ended: signal 9"));
    CHECK(here.answer("sea/two") == 7);
}

TEST_CASE("a component that fails in a shared process is started again there, alone") {
    shared_host here;
    int pid = here.share("sea/one", {"--restart", "on-failure"})["process_id"];
    here.share("sea/two");
    here.json_of({"call", "sea/one", "fail", R"({"text":"a leak"})"});
    wait_until([&] { return here.state("sea/one")["restarts"] == 1 && here.is("sea/one", "ready"); });
    CHECK(here.pid("sea/one") == pid);
    CHECK(here.pid("sea/two") == pid);
    CHECK(here.state("sea/two")["restarts"] == 0);
    auto refused = here.ise({"start", "trouble", "sea/three", "--process", "main", "--set", "failing=the mast is gone",
                             "--timeout", "120s"});
    CHECK(refused.exit_code == 1);
    CHECK_THAT(refused.err, Contains("'sea/three' did not start") && Contains("the mast is gone"));
    CHECK(here.answer("sea/two") == 7);
}

TEST_CASE("a thread that does not come back takes its process along, and the others are started again") {
    shared_host here;
    int pid = here.share("sea/stuck", {"--set", "stuck=true", "--grace", "200ms"})["process_id"];
    here.share("sea/two", {"--restart", "always"});
    CHECK(here.json_of({"stop", "sea/stuck", "--timeout", "120s"})["state"] == "stopped");
    wait_until([&] { return here.is_ready_again("sea/two", pid); });
    CHECK_FALSE(lives(pid));
}

TEST_CASE("a shared process goes on without its instantiation server, and is taken over by the next") {
    shared_host here;
    int pid = here.share("sea/one", {"--restart", "always"})["process_id"];
    here.share("sea/two");
    here.crash();
    CHECK(lives(pid));
    CHECK(here.answer("sea/two") == 7);
    here.open();
    for (const char* path : {"sea/one", "sea/two"}) {
        CHECK(here.state(path)["adopted"] == true);
        CHECK(here.pid(path) == pid);
    }
    CHECK(here.json_of({"stop", "sea/two"})["state"] == "stopped");
    CHECK(here.share("sea/two")["process_id"] == pid);
    send_signal(pid, SIGKILL);
    wait_until([&] { return here.is_ready_again("sea/one", pid); });
    here.crash();
    for (int one : marked()) send_signal(one, SIGKILL);
    wait_until([] { return marked().empty(); });
    here.open();
    wait_until([&] { return here.is("sea/one", "ready"); });
    CHECK(here.state("sea/two")["state"] == "failed");
}

TEST_CASE("what cannot share a process is refused with the reason") {
    shared_host here;
    here.install("atirma");
    here.share("sea/one");
    auto refused = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {"start", "--timeout", "120s"});
        auto ran = here.ise(std::move(words));
        CHECK(ran.exit_code == 2);
        return ran.err;
    };
    CHECK_THAT(
        refused({"web-server", "--process", "main"}),
        Contains("the process 'main' runs ise_trouble, of which 'sea/one' is one: what atirma has needs another"));
    CHECK_THAT(refused({"trouble", "sea/two", "--process", "../main"}),
               Contains("a shared process cannot be called '../main'"));
    CHECK_THAT(refused({"trouble", "sea/two", "--process", "main", "--env", "TROUBLE_FLAG=1"}),
               Contains("environment variables belong to a whole process"));
    CHECK(here.answer("sea/one") == 7);
}
