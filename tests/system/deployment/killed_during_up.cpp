// kill -9 of the servers while `ise up` is under way: it ends with a clear error, or goes on; `down` leaves nothing.
#include "two_hosts.hpp"

#include <system/instantiation/host.hpp>

#include <fstream>
#include <optional>

using namespace deployment_test;
using host_test::marked;
using host_test::wait_until;
using ise_test::Contains;

namespace {

/// A deployment whose second component does not become ready before `let_go()`.
struct held_up {
    two_hosts in;
    std::string file;
    std::filesystem::path began = in.folder() / "ports" / "began", may_go = in.folder() / "ports" / "may-go";
    std::optional<ise_test::program> up;

    explicit held_up(const std::string& ready_within) {
        file =
            in.file("sea.toml", "name = 'sea'\n[hosts.boat]\n[hosts.shore]\n"
                                "[components.one]\ntype = 'trouble'\nhost = 'shore'\nready-within = '60s'\n"
                                "[components.two]\ntype = 'trouble'\nhost = 'boat'\nafter = 'one'\nready-within = '" +
                                    ready_within +
                                    "'\n"
                                    "parameters = { meets = '" +
                                    began.string() + "', other = '" + may_go.string() + "' }\n");
        up.emplace(std::vector<std::string>{"ise", "--name-server", in.name_server(), "up", file});
        wait_until([&] { return std::filesystem::exists(began); });
        REQUIRE(in.is_ready("sea/one"));
    }
    void let_go() { std::ofstream touched(may_go); }
    /// After whatever happened: nothing of it is left, and it comes up as if nothing had been.
    void goes_down_and_comes_up() {
        in.done({"down", file});
        CHECK(marked().empty());
        CHECK(in.json_of({"ps"}).empty());
        let_go();
        CHECK_THAT(in.up(file), Contains("sea is up: 2 components, 2 steps"));
        in.done({"down", file});
        CHECK(marked().empty());
        std::filesystem::remove(began);
        std::filesystem::remove(may_go);
        CHECK(in.left_behind().empty());
    }
};

} // namespace

TEST_CASE("an up whose instantiation server is killed says so, undoes the rest, and can be done again") {
    held_up of("240s");
    of.in.crash("boat");
    auto ended = of.up->wait();
    INFO(ended.out << ended.err);
    CHECK(ended.exit_code != 0);
    CHECK_THAT(ended.err, Contains("step 2 of 2 failed (start sea/two on boat): the instantiation server of boat did "
                                   "not come to tell whether it did start sea/two") &&
                              Contains("what was done before was undone") &&
                              Contains("is ise_instantiation_server running on boat?"));
    of.in.open("boat");
    of.goes_down_and_comes_up();
}

TEST_CASE("an up whose name server is killed goes on when there is one again") {
    held_up of("240s");
    of.in.crash_name_server();
    of.let_go();
    of.in.start_name_server();
    auto ended = of.up->wait();
    INFO(ended.out << ended.err);
    CHECK(ended.exit_code == 0);
    CHECK(of.in.is_ready("sea/one"));
    CHECK(of.in.is_ready("sea/two"));
    of.goes_down_and_comes_up();
}

TEST_CASE("an up whose name server is killed and does not come back ends by its deadline with the reason") {
    held_up of("10s");
    of.in.crash_name_server();
    of.let_go();
    auto ended = of.up->wait();
    INFO(ended.out << ended.err);
    CHECK(ended.exit_code != 0);
    CHECK_THAT(ended.err, Contains("sea/two"));
    of.in.start_name_server();
    for (const char* host : {"boat", "shore"})
        of.in.done({"--wait", "--timeout", "120s", "describe", "--names", std::string("ise/host/") + host});
    of.goes_down_and_comes_up();
}
