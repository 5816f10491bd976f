// What a host runs out of: descriptors, ports, room on the disk, addresses.
#include "host.hpp"

#include <support/no_descriptors.hpp>

#include <asio/write.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/ip/udp.hpp>

#include <sched.h>
#include <unistd.h>
#include <test_folders.hpp>

using namespace host_test;
using ise_test::no_descriptors;
using ise_test::program;
using ise_test::run_program;

namespace {

// A program of this build that may open few files.
std::vector<std::string> with_descriptors(int most, std::vector<std::string> arguments) {
    std::vector<std::string> made{"/bin/sh", "-c", "ulimit -n " + std::to_string(most) + " && exec \"$0\" \"$@\"", ISE_BINARY_DIR "/bin/" + arguments[0]};
    made.insert(made.end(), arguments.begin() + 1, arguments.end());
    return made;
}

ise::task<ise::result<void>> connect(ise::remote to) { return to.connect(60s); }

// A network of this process's own, whose loopback is up: as root, or as root of a user namespace of its own.
bool own_network() {
    auto user = ::geteuid(), group = ::getegid();
    if (user == 0 ? ::unshare(CLONE_NEWNET) != 0 : ::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) return false;
    if (user != 0) {
        std::ofstream("/proc/self/setgroups") << "deny";
        std::ofstream("/proc/self/uid_map") << "0 " << user << " 1";
        std::ofstream("/proc/self/gid_map") << "0 " << group << " 1";
    }
    return std::system("ip link set lo up") == 0;
}

std::size_t count_of(const std::string& text, std::string_view what) {
    std::size_t found = 0;
    for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++found;
    return found;
}

} // namespace

TEST_CASE("host: out of file descriptors a provider keeps its sessions, says what to do, and accepts again later") {
    console shore;
    program vessel(with_descriptors(48, vessel_at("tcp://127.0.0.1:0")));
    auto at = vessel.read_line();
    shore.follow(at);
    shore.until([&] { return shore.heard > 5; });
    asio::io_context context;
    auto to = ise::endpoint::parse(at).value();
    asio::ip::tcp::endpoint there(asio::ip::make_address(to.host), to.port);
    std::vector<asio::ip::tcp::socket> strangers;
    for (int i = 0; i < 100; ++i) {
        strangers.emplace_back(context);
        strangers.back().connect(there);
    }
    // Behind a hundred that say nothing: the session that is there goes on, a new one is made when their time is over.
    for (int i = 0; i < 20; ++i) CHECK(shore.answer(shore.call(at, 10, 60s)));
    CHECK(run_program(ise_call(at, "nap", R"({"milliseconds":0})")).exit_code == 0);
    CHECK(shore.restarts == 0);
    CHECK(shore.lost == 0);
    vessel.signal(SIGTERM);
    auto ended = vessel.wait();
    CHECK(ended.exit_code == 0);
    INFO(ended.err);
    CHECK_THAT(ended.err, Contains("Too many open files") && Contains("ulimit -n"));
    CHECK(count_of(ended.err, "cannot accept") < 15); // not one for each attempt
}

TEST_CASE("host: over udp more are served than the provider has descriptors") {
    program vessel(with_descriptors(24, vessel_at("udp://127.0.0.1:0")));
    auto at = vessel.read_line();
    console shore;
    shore.follow(at);
    std::vector<ise::remote> all;
    for (int i = 0; i < 60; ++i) {
        auto& party = shore.all.add("client" + std::to_string(i));
        all.push_back(party.at(at));
        auto connected = shore.all.run(party, connect(all.back()));
        REQUIRE(connected);
    }
    CHECK(shore.answer(shore.call(at, 0, 60s)));
    CHECK(shore.restarts == 0);
    vessel.signal(SIGTERM);
    auto ended = vessel.wait();
    CHECK(ended.exit_code == 0);
    INFO(ended.err);
    CHECK_THAT(ended.err, !Contains("Too many open files"));
}

TEST_CASE("host: a caller that is out of file descriptors says so, and reaches its provider when it has some") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    program vessel(vessel_at(loopback(scheme)));
    auto at = vessel.read_line();
    console shore;
    no_descriptors full;
    auto got = shore.answer(shore.call(at, 0, 1s));
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == ise::errc::timed_out);
    CHECK(got.error().executed() == ise::execution::not_executed);
    CHECK_THAT(got.error().message(), Contains(at) && Contains("Too many open files") && Contains("ulimit -n"));
    auto waits = shore.call(at, 0, 60s);
    full.end();
    CHECK(shore.answer(waits));
}

TEST_CASE("host: a port in use ends each program with exit code 1, who to ask and what to do") {
    asio::io_context context;
    asio::ip::tcp::acceptor taken(context, {asio::ip::make_address("127.0.0.1"), 0});
    asio::ip::udp::socket taken_too(context, {asio::ip::make_address("127.0.0.1"), taken.local_endpoint().port()});
    auto port = std::to_string(taken.local_endpoint().port());
    auto at = "tcp://127.0.0.1:" + port, over_udp = "udp://127.0.0.1:" + port;
    std::vector<std::string> arguments;
    SECTION("the name server") { arguments = {"ise_name_server", "--listen", at}; }
    SECTION("the name server, over udp") { arguments = {"ise_name_server", "--listen", over_udp}; }
    SECTION("the page") {
        arguments = {"atirma", "run", "--name-server", "tcp://127.0.0.1:1", "web-server", "--address", "127.0.0.1", "--port", port};
    }
    SECTION("a component's endpoint") {
        arguments = {"atirma", "run", "--name-server", "tcp://127.0.0.1:1", "xbee-proxy", "--listen", at};
    }
    SECTION("a component's endpoint, over udp") {
        arguments = {"atirma", "run", "--name-server", "tcp://127.0.0.1:1", "xbee-proxy", "--listen", over_udp};
    }
    auto ran = run_program(arguments);
    INFO(arguments[0] << " " << arguments[1] << ": " << ran.out << ran.err);
    CHECK(ran.exit_code == 1);
    CHECK_THAT(ran.err, Contains(port) && Contains("already in use") && Contains("ss -l") && Contains("listen elsewhere"));
}

TEST_CASE("host: a full disk under what a program writes stops no service") {
    ise_test::start_options full;
    full.output_file = "/dev/full";
    console shore;
    program vessel({"/bin/sh", "-c", R"(exec "$0" "$@" 2>/dev/full)", ISE_BINARY_DIR "/bin/host_vessel", "-", "tcp://127.0.0.1:0"});
    auto at = vessel.read_line();
    CHECK(shore.answer(shore.call(at, 0, 60s)));
    asio::io_context context;
    auto to = ise::endpoint::parse(at).value();
    asio::ip::tcp::socket stranger(context);
    stranger.connect({asio::ip::make_address(to.host), to.port});
    asio::write(stranger, asio::buffer(std::string(100, 'x'))); // something to log about
    CHECK(shore.answer(shore.call(at, 0, 60s)));
    auto call = ise_call(at, "nap", R"({"milliseconds":0})");
    auto told = run_program(call, full); // what was asked for cannot be told
    CHECK(told.exit_code != 0);
    INFO(told.err);
    CHECK_THAT(told.err, Contains("No space left"));
    vessel.signal(SIGTERM);
    CHECK(vessel.wait().exit_code == 0);
}

TEST_CASE("host: an address that is taken from its interface and given back heals") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    if (!own_network() || std::system("ip addr add 10.99.0.1/32 dev lo") != 0) {
        ise_test::skip("taking addresses away needs a network namespace of one's own, which this user may not make");
        return;
    }
    console shore;
    program vessel(vessel_at(scheme + "://10.99.0.1:0"));
    auto at = vessel.read_line();
    shore.follow(at);
    shore.until([&] { return shore.heard > 5; });
    REQUIRE(std::system("ip addr del 10.99.0.1/32 dev lo") == 0);
    shore.until([&] { return shore.shore.services->sessions().empty(); }); // by its heartbeat, if not at once
    auto waits = shore.call(at, 0, 120s);
    REQUIRE(std::system("ip addr add 10.99.0.1/32 dev lo") == 0);
    CHECK(shore.answer(waits));
    auto before = shore.heard;
    shore.until([&] { return shore.heard > before + 5; });
    CHECK(shore.restarts == 0); // resumed: what is missing is known
    CHECK(shore.lost > 0);
}
