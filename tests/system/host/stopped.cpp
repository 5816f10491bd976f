// SIGSTOP for longer than a lease, and SIGCONT.
#include "host.hpp"

using namespace host_test;
using ise_test::program;

namespace {

// The name server's own endpoint, from what it says when it is up.
std::string endpoint_in(const std::string& line) {
    REQUIRE_THAT(line, Contains("listens on tcp://"));
    return line.substr(line.find("tcp://"));
}

std::string listed(const std::string& names) {
    return ise_test::run_program({"ise", "--name-server", names, "--timeout", "60s", "list", "--names"}).out;
}

// A name server, and a vessel that is registered there.
struct harbour {
    explicit harbour(const std::string& scheme) : vessel(vessel_at(loopback(scheme), server)), at(vessel.read_line()) {
        wait_for("host/vessel\n");
    }
    void wait_for(const std::string& expected) const {
        while (listed(server) != expected) {}
    }

    program names{{"ise_name_server", "--listen", "tcp://127.0.0.1:0", "--lease", "300ms", "--fresh"}};
    std::string server = endpoint_in(names.read_line());
    program vessel;
    std::string at;
};

} // namespace

TEST_CASE("host: a process stopped for longer than its lease loses its name and has it again when it goes on") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    harbour in(scheme);
    console shore;
    shore.follow(in.at);
    shore.until([&] { return shore.heard > 5; });

    in.vessel.signal(SIGSTOP);
    in.wait_for(""); // its lease is over
    in.vessel.signal(SIGCONT);
    in.wait_for("host/vessel\n");
    auto before = shore.heard;
    shore.until([&] { return shore.heard > before + 5; });
    CHECK(shore.restarts == 0); // the same life all the time
    CHECK(shore.answer(shore.call(in.at, 0, 60s)));
}

TEST_CASE("host: a name server stopped for longer than its leases is whole again when it goes on") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    harbour in(scheme);
    console shore;
    in.names.signal(SIGSTOP);
    for (int i = 0; i < 5; ++i) CHECK(shore.answer(shore.call(in.at, 200, 60s))); // more than three leases in all
    in.names.signal(SIGCONT);
    in.wait_for("host/vessel\n");
    CHECK(shore.answer(shore.call(in.at, 0, 60s)));
}

TEST_CASE("host: a process stopped for longer than its heartbeats is lost, and what it was doing is told truly when it "
          "goes on") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    console shore;
    program vessel(vessel_at(loopback(scheme)));
    auto at = vessel.read_line();
    shore.follow(at);
    shore.until([&] { return shore.heard > 5; });
    auto running = shore.call(at, 1000, 60s);
    REQUIRE(shore.answer(shore.call(at, 1, 60s))); // behind the other: that one has arrived
    vessel.signal(SIGSTOP);
    shore.until([&] { return shore.shore.services->sessions().empty(); });
    auto waits = shore.call(at, 0, 60s);
    vessel.signal(SIGCONT);
    CHECK(shore.answer(waits));
    auto got = shore.answer(running);
    if (scheme == "udp") {
        CHECK(got); // it outlives its session
    } else {
        REQUIRE_FALSE(got);
        CHECK(got.error().code() == ise::errc::peer_lost);
        CHECK(got.error().executed() == ise::execution::unknown);
    }
    auto before = shore.heard;
    shore.until([&] { return shore.heard > before + 5; });
    CHECK(shore.restarts == 0); // the same life: what is missing is known
}
