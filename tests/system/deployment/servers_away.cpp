// Commands that are given while a server has just started, or is away: a part of the system is never taken for all of
// it.
#include "two_hosts.hpp"

#include <system/instantiation/host.hpp>

#include <csignal>

using namespace deployment_test;
using host_test::marked;
using host_test::wait_until;
using ise_test::Contains;

namespace {

constexpr const char* both = "name = 'sea'\n[hosts.boat]\n[hosts.shore]\n"
                             "[components.one]\ntype = 'trouble'\nhost = 'boat'\n"
                             "[components.two]\ntype = 'trouble'\nhost = 'shore'\n";

// It was killed: the name server knows it until its lease has ended.
void forget_host(two_hosts& in, const std::string& host) {
    wait_until([&] {
        for (const auto& one : in.json_of({"list"}))
            if (one["path"] == "ise/host/" + host) return false;
        return true;
    });
}

} // namespace

TEST_CASE("what is asked right after the name server was started again is told of the whole system") {
    two_hosts in;
    auto file = in.file("sea.toml", both);
    in.up(file);
    in.crash_name_server();
    in.start_name_server();
    CHECK_THAT(in.done({"diff", file}), Contains("sea is as"));
    in.crash_name_server();
    in.start_name_server();
    CHECK(in.json_of({"ps"}).size() == 2);
    in.crash_name_server();
    in.start_name_server();
    CHECK_THAT(in.done({"down", file}), Contains("sea is down: 2 components, 2 steps"));
    CHECK(marked().empty());
}

TEST_CASE("what a killed instantiation server had started is not told to be down, and goes down when it is back") {
    two_hosts in;
    auto file = in.file("sea.toml", both);
    in.up(file);
    in.crash("boat");
    forget_host(in, "boat");
    auto alone = in.ise({"stop", "sea/one"});
    CHECK(alone.exit_code == 3);
    CHECK_THAT(alone.err, Contains("'sea/one' runs as process") &&
                              Contains("but no instantiation server that is registered has started it") &&
                              Contains("--state"));
    auto half = in.ise({"down", file});
    CHECK(half.exit_code == 3);
    CHECK_THAT(half.err, Contains("not all of sea is down: no instantiation server 'boat' is registered"));
    CHECK(marked().size() == 1); // the one on boat
    in.open("boat");
    in.done({"down", file});
    CHECK(marked().empty());
    CHECK(in.left_behind().empty());
}

TEST_CASE("a parameter is not set without the instantiation server that has to keep it, or with a warning") {
    two_hosts in;
    in.up(in.file("sea.toml", both));
    auto set = [&](const char* value) { return in.ise({"param", "set", "sea/one", "answer", value}); };
    auto answer = [&] { return in.json_of({"call", "sea/one", "ask"})["answer"]; };
    in.crash("boat");
    forget_host(in, "boat");
    auto lost = set("3");
    CHECK(lost.exit_code == 0);
    CHECK_THAT(lost.err, Contains("ise/host/boat on ") && Contains("holds until the next start only"));
    CHECK(answer() == 3);
    ise_test::start_options options;
    options.variables = {{"ISE_NAME_SERVER", in.name_server()}};
    ise_test::program silent( // registered as one, and answers no request to one
        {"ise_trouble", "run", "trouble", "--path=ise/host/boat", "--log-level=error"}, options);
    in.done({"--wait", "--timeout", "60s", "describe", "--names", "ise/host/boat"});
    auto refused = set("2");
    CHECK(refused.exit_code == 3);
    CHECK_THAT(refused.err, Contains("nothing was set") && Contains("the instantiation server of boat"));
    CHECK(answer() == 3);
    silent.signal(SIGTERM);
    silent.wait();
    in.open("boat");
    auto kept = set("4");
    CHECK(kept.exit_code == 0);
    CHECK(kept.err.empty());
    CHECK(in.state("sea/one")["arguments"][0]["value"] == "4");
}

TEST_CASE("the components of a host that is gone for good are moved to another one") {
    two_hosts in;
    auto file = in.file("sea.toml", both);
    in.up(file);
    auto lost = in.state("sea/one")["process_id"].get<int>();
    auto kept = in.state("sea/two")["process_id"].get<int>();
    in.crash("boat");
    host_test::send_signal(lost, SIGKILL);
    forget_host(in, "boat");
    auto without = in.ise({"up", file});
    CHECK(without.exit_code == 2);
    CHECK_THAT(without.err, Contains("no instantiation server 'boat' is registered"));
    CHECK_THAT(in.ise({"up", file, "--move-from", "bota=shore"}).err,
               Contains("--move-from: the file has no host 'bota'; there are boat, shore"));
    CHECK_THAT(in.ise({"up", file, "--move-from", "boat=shroe"}).err, Contains("the file has no host 'shroe'"));
    CHECK_THAT(in.ise({"up", file, "--move-from", "boat"}).err, Contains("--move-from takes HOST=OTHER"));
    auto text = in.up(file, {"--move-from", "boat=shore"});
    CHECK_THAT(text, Contains("start sea/one on shore") && Contains("sea is up: 2 components, 1 step"));
    CHECK(in.state("sea/one")["host"] == "shore");
    CHECK(in.state("sea/two")["process_id"].get<int>() == kept);
    CHECK_THAT(in.up(file, {"--move-from", "boat=shore"}), Contains("nothing to do"));
    in.done({"down", file, "--move-from", "boat=shore"});
    CHECK(marked().empty());
}
