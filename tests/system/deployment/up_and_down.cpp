// Deployments of small components on two hosts: up, again, otherwise, and down.
#include "two_hosts.hpp"

#include <system/instantiation/host.hpp>

#include <fstream>
#include <iterator>
#include <test_folders.hpp>

using namespace deployment_test;
using host_test::lives;
using host_test::marked;
using host_test::wait_until;
using ise_test::Contains;

namespace {

const std::string two_hosts_of_sea = "name = 'sea'\n[hosts.boat]\n[hosts.shore]\n";

std::string component(const std::string& name, const std::string& host, const std::string& more = "") {
    return "[components." + name + "]\ntype = 'trouble'\nhost = '" + host + "'\nready-within = '60s'\n" + more;
}

std::string sea(const std::string& components) { return two_hosts_of_sea + components; }

/// Puts the same program there as one that was linked again: with another build id, or another size where it has none.
void rebuild(const std::filesystem::path& program) {
    std::ifstream from(program, std::ios::binary);
    std::string content(std::istreambuf_iterator<char>(from), {});
    const std::string note("\4\0\0\0\x14\0\0\0\3\0\0\0GNU\0", 16);
    auto at = content.find(note);
    if (at != content.npos) content[at + note.size()] ^= 1;
    auto fresh = program.string() + ".new";
    std::ofstream(fresh, std::ios::binary) << content << '\0';
    std::filesystem::permissions(fresh, std::filesystem::perms::owner_all);
    std::filesystem::rename(fresh, program);
}

} // namespace

TEST_CASE("a deployment comes up in order, is up the second time, and goes down leaving nothing") {
    two_hosts in;
    auto file = in.file(
        "sea.toml",
        sea(component("one", "boat", "after = 'two'\n") +
            component("two", "shore", "parameters = { answer = 3, say = 'here' }\nroles = { 'sea/best' = 4 }\n")));
    CHECK_THAT(in.done({"diff", file}), Contains("start sea/two on shore\nstart sea/one on boat\n"));
    auto text = in.up(file);
    INFO(text);
    CHECK(text.find("[1/2] start sea/two on shore") < text.find("[2/2] start sea/one on boat"));
    CHECK_THAT(text, Contains("ready after") && Contains("sea is up: 2 components, 2 steps"));
    CHECK(in.json_of({"call", "sea/best", "ask"})["answer"] == 3);
    CHECK(in.state("sea/one")["host"] == "boat");
    int pid = in.state("sea/two")["process_id"];
    CHECK_THAT(in.up(file), Contains("sea is up: 2 components, nothing to do"));
    CHECK_THAT(in.done({"diff", file}), Contains("sea is as"));
    CHECK(in.state("sea/two")["process_id"] == pid);
    auto down = in.done({"down", file});
    INFO(down);
    CHECK(down.find("stop sea/one") < down.find("stop sea/two"));
    CHECK(marked().empty());
    CHECK(in.json_of({"ps"}).empty());
    CHECK(in.left_behind().empty());
    CHECK_THAT(in.done({"down", file}), Contains("sea is down"));
}

TEST_CASE("components that do not wait for each other are started together, and the others in their order") {
    two_hosts in;
    // Each of the first two waits until the other runs: one after the other they never come up.
    auto meets = [&](const std::string& mine, const std::string& other) {
        return "parameters = { meets = '" + (in.folder() / "ports" / mine).string() + "', other = '" +
               (in.folder() / "ports" / other).string() + "' }\n";
    };
    auto file = in.file("sea.toml", sea(component("last", "boat", "after = ['one', 'two']\n") +
                                        component("one", "boat", meets("one", "two")) +
                                        component("two", "shore", meets("two", "one"))));
    auto text = in.up(file);
    INFO(text);
    auto last = text.find("start sea/last on boat");
    CHECK(text.find("start sea/one on boat: ready") < last);
    CHECK(text.find("start sea/two on shore: ready") < last);
    CHECK(last != std::string::npos);
    auto down = in.done({"down", file});
    INFO(down);
    CHECK(down.find("stop sea/last on boat: ") < down.find("stop sea/one on boat\n"));
    CHECK(down.find("stop sea/last on boat: ") < down.find("stop sea/two on shore\n"));
    CHECK(marked().empty());
    CHECK(in.json_of({"ps"}).empty());
}

TEST_CASE("some components of a deployment come up with those they come after, and go down alone") {
    two_hosts in;
    auto file = in.file("sea.toml", sea(component("one", "boat") + component("two", "shore", "after = 'one'\n") +
                                        component("three", "boat", "after = 'two'\n")));
    CHECK_THAT(in.done({"up", file, "two"}),
               Contains("[1/2] start sea/one on boat") && Contains("sea is up: 2 components, 2 steps"));
    CHECK(in.is_ready("sea/one"));
    CHECK(in.is_ready("sea/two"));
    CHECK(in.json_of({"ps"}).size() == 2);
    CHECK_THAT(in.done({"diff", file}), Contains("start sea/three on boat"));
    auto unknown = in.ise({"up", file, "tow"});
    CHECK(unknown.exit_code == 2);
    CHECK_THAT(unknown.err, Contains("there is no component 'tow' in it; did you mean 'two'?"));
    CHECK(in.ise({"down", file, "tow"}).exit_code == 2);
    in.done({"down", file, "sea/two"});
    CHECK(in.json_of({"ps"}).size() == 1);
    CHECK(in.is_ready("sea/one"));
    in.done({"down", file});
    CHECK(marked().empty());
}

TEST_CASE("an up that is interrupted undoes what it did, unless it is to be kept") {
    two_hosts in;
    auto file = in.file("sea.toml", sea(component("one", "boat") +
                                        component("two", "shore", "after = 'one'\nparameters = { silent = true }\n")));
    for (bool keep : {false, true}) {
        std::vector<std::string> words{"ise", "--name-server", in.name_server(), "up", file};
        if (keep) words.push_back("--keep");
        ise_test::program up(words);
        while (up.read_line().find("start sea/two") == std::string::npos) {}
        wait_until([&] { return !in.state("sea/two").is_null(); });
        up.signal(SIGINT);
        auto ran = up.wait();
        INFO(ran.out << ran.err);
        CHECK(ran.exit_code == 130);
        CHECK_THAT(ran.err, Contains("interrupted: 1 of 2 steps were done"));
        if (keep) {
            CHECK(in.is_ready("sea/one"));
        } else {
            CHECK_THAT(ran.err, Contains("what was done before was undone"));
            CHECK(marked().empty());
            CHECK(in.json_of({"ps"}).empty());
        }
    }
    in.done({"down", file});
    CHECK(marked().empty());
}

TEST_CASE("components of one file share a process") {
    two_hosts in;
    auto file = in.file("sea.toml", sea(component("one", "boat", "process = 'main'\n") +
                                        component("two", "boat", "process = 'main'\n") +
                                        component("three", "shore", "process = 'main'\n")));
    in.up(file);
    CHECK(in.state("sea/one")["process_id"] == in.state("sea/two")["process_id"]);
    CHECK(in.state("sea/one")["process_id"] != in.state("sea/three")["process_id"]);
    CHECK_THAT(in.up(file), Contains("nothing to do"));
    auto apart = in.file("apart.toml", sea(component("one", "boat", "process = 'main'\n") + component("two", "boat") +
                                           component("three", "shore", "process = 'main'\n")));
    CHECK_THAT(in.up(apart), Contains("restart sea/two on boat\n    process: main -> (none)"));
    CHECK(in.state("sea/one")["process_id"] != in.state("sea/two")["process_id"]);
    in.done({"down", apart});
    CHECK(marked().empty());
    CHECK(in.left_behind().empty());
}

TEST_CASE("what it started is undone when a deployment fails, unless it is to be kept") {
    two_hosts in;
    auto file = in.file(
        "sea.toml", sea(component("one", "boat") +
                        component("two", "shore", "after = 'one'\nparameters = { failing = 'the sea is rough' }\n")));
    auto failed = in.ise({"up", file});
    INFO(failed.out << failed.err);
    CHECK(failed.exit_code == 1);
    CHECK_THAT(failed.err, Contains("step 2 of 2 failed") && Contains("the sea is rough") &&
                               Contains("what was done before was undone"));
    CHECK_THAT(failed.out, Contains("start sea/one on boat: undone"));
    CHECK(marked().empty());
    auto kept = in.ise({"up", file, "--keep"});
    CHECK(kept.exit_code == 1);
    CHECK_THAT(kept.err, Contains("what was done before stays"));
    CHECK(in.is_ready("sea/one"));
    in.done({"down", file});
    CHECK(marked().empty());
}

TEST_CASE("the doctor tells what has failed, and what waits to be started again") {
    two_hosts in;
    auto file = in.file(
        "sea.toml",
        sea(component("one", "boat", "restart = { policy = 'always', first-pause = '300s', max-pause = '300s' }\n") +
            component("two", "shore")));
    in.up(file);
    for (const char* path : {"sea/one", "sea/two"}) {
        int pid = in.state(path)["process_id"];
        host_test::send_signal(pid, SIGKILL);
        wait_until([&] { return in.state(path)["process_id"] == 0; });
    }
    auto sick = in.ise({"doctor"});
    INFO(sick.out << sick.err);
    CHECK(sick.exit_code == 1);
    CHECK_THAT(
        sick.out,
        Contains("sea/one: it ended on boat and is about to be started again (0 times so far): signal 9 (Killed)"));
    CHECK_THAT(sick.out, Contains("sea/two: it has failed on shore and is not started again: signal 9 (Killed)") &&
                             Contains("ise logs sea/two"));
    in.done({"down", file});
    CHECK_THAT(in.ise({"doctor"}).out, !Contains("started again"));
}

TEST_CASE("the doctor finds what was started by hand and has failed, until it is stopped") {
    two_hosts in;
    in.done({"start", "trouble", "sea/one", "--host", "boat", "--timeout", "120s", "--ready-within", "60s"});
    int pid = in.state("sea/one")["process_id"];
    host_test::send_signal(pid, SIGKILL);
    wait_until([&] { return in.state("sea/one")["process_id"] == 0; });
    auto sick = in.ise({"doctor"});
    INFO(sick.out << sick.err);
    CHECK(sick.exit_code == 1);
    CHECK_THAT(sick.out,
               Contains("sea/one: it has failed on boat and is not started again") && !Contains("nothing is wrong"));
    in.done({"stop", "sea/one"});
    CHECK_THAT(in.ise({"doctor"}).out, !Contains("it has failed"));
}

TEST_CASE("what is against a deployment is told before anything is started") {
    two_hosts in;
    auto refused = [&](const std::string& second, const std::string& why) {
        auto file =
            in.file("sea.toml", sea(component("one", "boat") + component("two", "shore", "after = 'one'\n" + second)));
        for (const char* command : {"validate", "up"}) {
            auto ran = in.ise({command, file});
            INFO(command << ": " << ran.out << ran.err);
            CHECK(ran.exit_code == 2);
            CHECK(ran.out.empty());
            CHECK_THAT(ran.err, Contains("sea.toml:8:13: ") && Contains(why));
        }
        CHECK(in.json_of({"ps", "sea"}).empty());
    };
    refused("listen = 'tcp://0.0.0.0:7411'\n", "--allow-address");
    refused("parameters = { outlet = 'tcp://0.0.0.0:7411' }\n", "--allow-address");
    refused("parameters = { file = '/etc/passwd' }\n", "--allow-path");
    auto taken = in.name_server();
    refused("listen = '" + taken + "'\n", taken);
    refused("parameters = { outlet = '" + taken + "' }\n", taken);
    ise_test::program holder(
        {ISE_BINARY_DIR "/bin/ise_trouble", "run", "trouble", "--path=sea/two", "--name-server=" + in.name_server()});
    in.done({"--wait", "--timeout", "60s", "describe", "--names", "sea/two"});
    refused("", "'sea/two' is held by process");
    holder.signal(SIGTERM);
    holder.wait();
}

TEST_CASE("a program that was rebuilt is told and started again") {
    two_hosts in;
    auto program = in.folder() / "programs" / "ise_trouble";
    std::filesystem::remove(program);
    std::filesystem::copy_file(ISE_BINARY_DIR "/bin/ise_trouble", program);
    auto file = in.file("sea.toml", sea(component("one", "boat") + component("two", "shore", "process = 'main'\n") +
                                        component("three", "shore", "process = 'main'\n")));
    in.up(file);
    int before = in.state("sea/one")["process_id"];
    std::filesystem::copy_file(program, in.folder() / "fresh"); // copied again, it is the same program
    std::filesystem::rename(in.folder() / "fresh", program);
    CHECK_THAT(in.up(file), Contains("nothing to do"));
    rebuild(program);
    CHECK(in.state("sea/one")["rebuilt"] == true);
    CHECK_THAT(in.done({"ps"}), Contains("program was rebuilt"));
    CHECK_THAT(in.done({"diff", file}),
               Contains("restart sea/one on boat\n    program was rebuilt  (takes a restart)") &&
                   Contains("restart sea/two on shore") && Contains("restart sea/three on shore"));
    CHECK_THAT(in.ise({"doctor"}).out,
               Contains("sea/one: it runs a program that was rebuilt on boat since it was started"));
    CHECK_THAT(in.up(file), Contains("sea is up: 3 components, 3 steps"));
    CHECK(in.state("sea/one")["process_id"] != before);
    for (const char* path : {"sea/one", "sea/two", "sea/three"}) CHECK(in.state(path)["rebuilt"] == false);
    CHECK(in.state("sea/two")["process_id"] == in.state("sea/three")["process_id"]);
    CHECK_THAT(in.up(file), Contains("nothing to do"));
}

TEST_CASE("a change that fails leaves what ran before") {
    two_hosts in;
    auto before = in.file("before.toml", sea(component("one", "boat") +
                                             component("two", "boat", "after = 'one'\nparameters = { say = 'a' }\n") +
                                             component("old", "shore")));
    in.up(before);
    auto after =
        in.file("after.toml", sea(component("one", "boat", "parameters = { answer = 2 }\n") +
                                  component("two", "shore", "after = 'one'\nparameters = { say = 'b' }\n") +
                                  component("three", "shore", "after = 'two'\nparameters = { failing = 'reef' }\n")));
    auto failed = in.ise({"up", after});
    INFO(failed.out << failed.err);
    CHECK(failed.exit_code == 1);
    CHECK_THAT(failed.err, Contains("what was done before was undone\n"));
    CHECK(in.json_of({"call", "sea/one", "ask"})["answer"] == 7);
    CHECK(in.state("sea/two")["host"] == "boat");
    CHECK(in.is_ready("sea/two"));
    CHECK(in.is_ready("sea/old"));
    auto rest = in.ise({"diff", before});
    CHECK_THAT(rest.out, !Contains("start") && !Contains("change"));
}

TEST_CASE("a running deployment is changed: in place, by a restart, by a move, by more and by less") {
    two_hosts in;
    in.up(
        in.file("sea.toml", sea(component("calm", "boat") + component("changed", "boat") + component("again", "boat") +
                                component("moves", "boat") + component("goes", "shore"))));
    auto pid = [&](const std::string& name) { return in.state("sea/" + name)["process_id"].get<int>(); };
    int calm = pid("calm"), changed = pid("changed"), again = pid("again"), moves = pid("moves");
    auto file = in.file("sea.toml", sea(component("calm", "boat") +
                                        component("changed", "boat", "parameters = { answer = 2.5 }\n") +
                                        component("again", "boat", "parameters = { say = 'again' }\n") +
                                        component("moves", "shore") + component("comes", "shore")));
    auto text = in.up(file);
    INFO(text);
    CHECK_THAT(text, Contains("stop sea/goes on shore (it is not in the file any more)") &&
                         Contains("change sea/changed on boat\n    answer: 7 -> 2.5") &&
                         Contains("restart sea/again on boat\n    say: (none) -> again") &&
                         Contains("start sea/moves on shore (it moves from boat)") &&
                         Contains("start sea/comes on shore"));
    CHECK(pid("calm") == calm);
    CHECK(pid("changed") == changed);
    CHECK(in.json_of({"call", "sea/changed", "ask"})["answer"] == 2.5);
    CHECK(pid("again") != again);
    CHECK_FALSE(lives(moves));
    CHECK(in.state("sea/moves")["host"] == "shore");
    CHECK(in.json_of({"ps"}).size() == 5); // of what has gone, nothing is kept
    CHECK_THAT(in.up(file), Contains("nothing to do"));
}

TEST_CASE("a component that refuses a change, and values that are not allowed, end an up with the reason") {
    two_hosts in;
    in.up(in.file("sea.toml", sea(component("one", "boat"))));
    auto vetoed = in.ise({"up", in.file("sea.toml", sea(component("one", "boat", "parameters = { answer = 9 }\n")))});
    CHECK(vetoed.exit_code == 1);
    CHECK_THAT(vetoed.err, Contains("step 1 of 1 failed") && Contains("sea/one refuses it: nine is no answer") &&
                               !Contains("ise.change_parameters"));
    auto file = in.file("sea.toml", sea(component("one", "boat", "parameters = { answer = 11, anwser = 1 }\n")));
    for (const char* command : {"up", "diff", "validate"}) {
        auto wrong = in.ise({command, file});
        CHECK(wrong.exit_code == 2);
        CHECK_THAT(wrong.err,
                   Contains("sea.toml:8:25: parameter 'answer' cannot be '11': it must be a number from 0 to 10 (m)"));
        CHECK_THAT(wrong.err,
                   Contains("sea.toml:8:29: type 'trouble' has no parameter 'anwser'; did you mean 'answer'?"));
    }
    CHECK(in.json_of({"call", "sea/one", "ask"})["answer"] == 7);
}

TEST_CASE("what others have started is left alone") {
    two_hosts in;
    in.done({"start", "trouble", "sea/one", "--host", "boat", "--timeout", "120s", "--ready-within", "60s"});
    auto file = in.file("sea.toml", sea(component("one", "boat")));
    auto refused = in.ise({"up", file});
    CHECK(refused.exit_code == 2);
    CHECK_THAT(refused.err, Contains("sea.toml:4:13: 'sea/one' runs on boat already, and was started by hand"));
    in.done({"down", file});
    CHECK(in.is_ready("sea/one"));
}

TEST_CASE("hosts that are not there, and files that are none, are told with their place") {
    two_hosts in;
    auto nowhere =
        in.ise({"up", in.file("a.toml", "name='sea'\n[hosts.moon]\nserver='shoer'\n[components.x]\ntype='trouble'\n")});
    CHECK(nowhere.exit_code == 2);
    CHECK_THAT(nowhere.err, Contains("a.toml:2:8: no instantiation server 'shoer' is registered; did you mean 'shore'? "
                                     "Else start it on that host: ise_instantiation_server"));
    auto none = in.ise({"up", in.folder().string() + "/none.toml"});
    CHECK(none.exit_code == 2);
    CHECK_THAT(none.err, Contains("none.toml"));
    auto broken = in.ise({"validate", "--offline", in.file("b.toml", "name = 'sea\n"), "--json"});
    CHECK(broken.exit_code == 2);
    CHECK_THAT(broken.err, Contains(R"("error":"bad_deployment")") && Contains("b.toml:1:"));
    // Some of its mistakes are told by the file alone, others by the host.
    auto three =
        in.ise({"validate",
                in.file("d.toml", sea(component("one", "boat", "restart = 'sometimes'\nparameters = { anwser = 1 }\n") +
                                      "[components.two]\ntype = 'truoble'\nhost = 'boat'\nafter = 'on'\n"))});
    CHECK(three.exit_code == 2);
    CHECK_THAT(
        three.err,
        Contains("d.toml:8:11: the restart policy of component 'one' is never, on-failure or always, not 'sometimes'"));
    CHECK_THAT(three.err, Contains("type 'trouble' has no parameter 'anwser'; did you mean 'answer'?"));
    CHECK_THAT(three.err, Contains("host 'boat' has no component type 'truoble'; did you mean 'trouble'?"));
    CHECK_THAT(three.err, Contains("there is no component 'on'; did you mean 'one'?"));
    auto well = in.ise({"validate", in.file("c.toml", sea(component("one", "boat")))});
    CHECK(well.exit_code == 0);
    CHECK_THAT(well.out, Contains("c.toml is valid: sea with 1 component on 2 hosts; all types"));
}

TEST_CASE("a file is validated without anybody to ask") {
    two_hosts in;
    auto file = in.file("sea.toml", sea(component("one", "boat", "parameters = { no = 'such' }\n")));
    in.crash_name_server();
    auto alone = in.ise({"validate", file});
    INFO(alone.err);
    CHECK(alone.exit_code == 0);
    CHECK_THAT(alone.err, Contains("types and parameters were not checked: there is no name server at"));
    CHECK(in.ise({"validate", "--offline", file}).err.empty());
    in.start_name_server();
}

TEST_CASE("an instantiation server that is killed in between knows its part of the deployment again") {
    two_hosts in;
    auto file = in.file(
        "sea.toml",
        sea(component("one", "boat", "parameters = { answer = 2 }\nrestart = 'always'\nroles = { 'sea/best' = 1 }\n")));
    in.up(file);
    in.done({"param", "set", "sea/one", "answer", "4"});
    int pid = in.state("sea/one")["process_id"];
    in.crash("boat");
    CHECK(lives(pid));
    in.open("boat");
    CHECK(in.done({"diff", file}) == "change sea/one on boat\n    answer: 4 -> 2\n");
    host_test::send_signal(pid, SIGKILL);
    wait_until([&] {
        auto now = in.state("sea/one");
        return now["state"] == "ready" && now["process_id"] != pid;
    });
    CHECK(in.json_of({"call", "sea/one", "ask"})["answer"] == 4); // what was set holds in the next life
    in.done({"down", file});
    CHECK(marked().empty());
    CHECK(in.left_behind().empty());
}
