// What a component starts stays within its limits and ends with it, whatever it does to get away.
#include "host.hpp"

#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <sys/mount.h>
#include <unistd.h>

using namespace host_test;
using ise_test::Contains;

namespace {

bool has_own_mounts() { return ::geteuid() == 0 && std::getenv("ISE_IN_PID_NAMESPACE"); }

/// As long as it lives no control groups (version 2) are seen here.
class without_cgroups {
public:
    without_cgroups() {
        std::ifstream lines("/proc/self/mounts");
        std::string device, where, kind, rest;
        while (lines >> device >> where >> kind && std::getline(lines, rest))
            if (kind == "cgroup2") places_.push_back(where);
        for (const auto& place : places_)
            if (::umount2(place.c_str(), MNT_DETACH) != 0) throw std::runtime_error("cannot unmount " + place);
    }
    ~without_cgroups() {
        for (const auto& place : places_) ::mount("cgroup2", place.c_str(), "cgroup2", 0, nullptr);
    }
    without_cgroups(const without_cgroups&) = delete;
    without_cgroups& operator=(const without_cgroups&) = delete;

private:
    std::vector<std::string> places_;
};

/// At most so many processes of this test and all that it starts, whatever goes wrong.
class process_ceiling {
public:
    explicit process_ceiling(int most) {
        std::string pattern = "/sys/fs/cgroup/pids/ise-test-XXXXXX";
        if (!::mkdtemp(pattern.data())) return;
        folder_ = pattern;
        there_ = write("pids.max", std::to_string(most)) && write("cgroup.procs", "0");
    }
    ~process_ceiling() {
        if (folder_.empty()) return;
        std::ofstream("/sys/fs/cgroup/pids/cgroup.procs") << "0";
        ::rmdir(folder_.c_str());
    }
    process_ceiling(const process_ceiling&) = delete;
    process_ceiling& operator=(const process_ceiling&) = delete;
    bool there() const { return there_; }

private:
    bool write(const char* name, const std::string& text) {
        std::ofstream to(folder_ + "/" + name);
        to << text << std::flush;
        return to.good();
    }
    std::string folder_;
    bool there_ = false;
};

int escaped_from(host& here) {
    int pid = here.json_of({"call", "sea/one", "escape", "--timeout", "60s"})["pid"];
    REQUIRE(pid > 1);
    REQUIRE(lives(pid));
    return pid;
}

void check_escapes() {
    host here;
    here.open();
    here.start("sea/one");
    int pid = escaped_from(here);
    here.json_of({"stop", "sea/one"});
    CHECK_FALSE(lives(pid));

    int leader = here.start("sea/one")["process_id"];
    pid = escaped_from(here);
    here.crash();
    CHECK(lives(pid));
    send_signal(leader, SIGKILL); // and no instantiation server is there
    wait_until([&] { return !lives(pid); });

    here.open();
    here.start("sea/one");
    pid = escaped_from(here);
    here.crash();
    here.open();
    here.json_of({"kill", "sea/one"});
    CHECK_FALSE(lives(pid));
    here.start("sea/one");
    pid = escaped_from(here);
    CHECK(here.close() == 0);
    CHECK_FALSE(lives(pid));
    here.open();
}

void check_bomb() {
    host here;
    here.open();
    here.start("sea/one");
    here.start("sea/two");
    here.ise({"call", "sea/one", "bomb", "--timeout", "60s"});
    wait_until([&] {
        return here.ise({"call", "sea/two", "ask", "--timeout", "60s"}).exit_code == 0 &&
               here.state("sea/one")["process_id"] == 0;
    });
    auto now = here.state("sea/one");
    CHECK(now["state"] == "failed");
    CHECK_THAT(now["reason"].get<std::string>(), Contains("its limit of 256 (pids)"));
    CHECK(marked().size() == 1);
    CHECK_THAT(here.ise({"logs", "sea/one", "-n", "1"}).out, Contains("its limit of 256 (pids)"));
}

} // namespace

TEST_CASE("a process that left group, session and environment of its component ends with it") { check_escapes(); }

TEST_CASE("the same where there are no control groups") {
    if (!has_own_mounts()) return ise_test::skip("takes root, to hide the control groups");
    without_cgroups hidden;
    check_escapes();
}

TEST_CASE("a fork bomb ends with its component, and others go on") {
    if (!has_own_mounts()) return ise_test::skip("takes root, to bound what the test may do");
    process_ceiling ceiling(3000);
    if (!ceiling.there())
        return ise_test::skip("takes a control group (version 1) of pids, to bound what the test may do");
    check_bomb();
}

TEST_CASE("a fork bomb ends with its component where there are no control groups") {
    if (!has_own_mounts()) return ise_test::skip("takes root, to bound what the test may do");
    process_ceiling ceiling(3000);
    if (!ceiling.there())
        return ise_test::skip("takes a control group (version 1) of pids, to bound what the test may do");
    without_cgroups hidden;
    check_bomb();
}

TEST_CASE("a component that takes more memory than its limit is ended, and its limits are shown") {
    host here;
    here.open();
    auto result = here.start("sea/one", {"--limit", "memory=400MiB", "--limit", "pids=50"});
    CHECK(result["limits"]["pids"] == 50);
    CHECK(result["limits"]["memory"] == 400 << 20);
    here.ise({"call", "sea/one", "eat", R"({"mebibytes": 600})", "--timeout", "60s"});
    wait_until([&] { return here.state("sea/one")["process_id"] == 0; });
    CHECK_THAT(here.state("sea/one")["reason"].get<std::string>(),
               Contains("its limit of memory (pids=50 memory=400MiB)"));
    CHECK_THAT(here.ise({"start", "trouble", "sea/two", "--limit", "pids=0"}).err,
               Contains("the limit pids is a number of processes and threads from 1 to 32768, such as 64, not '0'"));
    CHECK_THAT(here.ise({"start", "trouble", "sea/two", "--process", "main", "--limit", "pids=9"}).err,
               Contains("limits belong to a whole process"));
}

TEST_CASE("a limit that cannot be kept is refused") {
    if (!has_own_mounts()) return ise_test::skip("takes root, to hide the control groups");
    without_cgroups hidden;
    host here;
    here.open();
    CHECK_THAT(here.ise({"start", "trouble", "sea/one", "--limit", "cpus=0.5"}).err,
               Contains("the limit of processors cannot be kept here"));
}
