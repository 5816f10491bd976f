// What a host runs out of: descriptors, ports, room on the disk, addresses.
#include "host.hpp"

#include <support/no_descriptors.hpp>

#include <asio/buffer.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/ip/udp.hpp>
#include <asio/local/stream_protocol.hpp>
#include <asio/write.hpp>

#include <sched.h>
#include <test_folders.hpp>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <thread>

using namespace host_test;
using ise_test::no_descriptors;
using ise_test::program;
using ise_test::run_program;

namespace {

// A program of this build that may open few files.
std::vector<std::string> with_descriptors(int most, std::vector<std::string> arguments) {
    std::vector<std::string> made{"/bin/sh", "-c", "ulimit -n " + std::to_string(most) + " && exec \"$0\" \"$@\"",
                                  ISE_BINARY_DIR "/bin/" + arguments[0]};
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

class scratch_folder {
public:
    scratch_folder() : path_((std::filesystem::temp_directory_path() / "ise-scarce-XXXXXX").string()) {
        REQUIRE(::mkdtemp(path_.data()));
    }
    ~scratch_folder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    scratch_folder(const scratch_folder&) = delete;
    scratch_folder& operator=(const scratch_folder&) = delete;
    std::string file(const std::string& name) const { return path_ + "/" + name; }

private:
    std::string path_;
};

using address = asio::ip::tcp::endpoint;

std::uint16_t free_port() {
    asio::io_context context;
    asio::ip::tcp::acceptor any(context, {asio::ip::make_address("127.0.0.1"), 0});
    return any.local_endpoint().port();
}

/// Connections that the kernel has made and the program has not accepted yet; -1: nobody listens there.
int backlog(std::uint16_t port) {
    std::ifstream table("/proc/net/tcp");
    std::string line;
    std::getline(table, line);
    while (std::getline(table, line)) {
        std::istringstream words(line);
        std::string number, local, remote, state, queues;
        words >> number >> local >> remote >> state >> queues;
        if (state != "0A" || std::stoul(local.substr(local.find(':') + 1), nullptr, 16) != port) continue;
        return static_cast<int>(std::stoul(queues.substr(queues.find(':') + 1), nullptr, 16));
    }
    return -1;
}

/// What a program answers to one more who says `words`, until it closes, or has said `enough`.
std::string ask(std::uint16_t port, const std::string& words, const std::string& enough) {
    asio::io_context context;
    asio::ip::tcp::socket socket(context);
    socket.connect(address(asio::ip::make_address("127.0.0.1"), port));
    std::error_code failed;
    asio::write(socket, asio::buffer(words), failed);
    std::string heard;
    std::array<char, 4096> room;
    while (!failed && (enough.empty() || heard.find(enough) == std::string::npos))
        heard.append(room.data(), socket.read_some(asio::buffer(room), failed));
    return failed && failed != asio::error::eof && failed != asio::error::connection_reset ? failed.message()
                                                                                           : heard + "<end>";
}

} // namespace

TEST_CASE("host: a program whose descriptors are held by idle connections serves one more, and accepts again when they "
          "are free") {
    struct channel {
        std::string name, words, answer;
        std::vector<std::string> arguments; // PORT and FILE stand for a port and a file
    };
    std::vector<std::string> iridium{"iridium-proxy", "--imei", "300234010753370", "--database", "FILE"};
    auto of_iridium = [&](std::vector<std::string> more) {
        more.insert(more.begin(), iridium.begin(), iridium.end());
        return more;
    };
    auto one = GENERATE_REF(values<channel>({
        {"the page",
         "GET /api/status HTTP/1.1\r\nHost: x\r\n\r\n",
         "200 OK",
         {"web-server", "--address", "127.0.0.1", "--port", "PORT"}},
        {"the web hook", "POST /rockblock/mo HTTP/1.1\r\nContent-Length: 1\r\n\r\nx", "400 Bad Request",
         of_iridium({"--webhook", "tcp://127.0.0.1:PORT"})},
        {"DirectIP", std::string("\xff\xff\xff\xff", 4), "<end>",
         of_iridium({"--webhook", "", "--directip", "tcp://127.0.0.1:PORT"})},
        {"the boat's channel", "no login\r\n", "<end>", {"gprs-proxy", "--boat-listen", "tcp://127.0.0.1:PORT"}},
        {"NMEA 0183", "", "", {"nmea-bridge", "--nmea-tcp", "tcp://127.0.0.1:PORT"}},
        {"viewers", "GET / HTTP/1.1\r\nHost: x\r\n\r\n", "426 Upgrade Required", {"foxglove-boat", "--port", "PORT"}},
    }));
    INFO(one.name);
    scratch_folder folder;
    const auto port = free_port();
    std::vector<std::string> arguments{"atirma", "run", "--name-server", "tcp://127.0.0.1:1"};
    for (auto text : one.arguments) {
        if (auto at = text.find("PORT"); at != std::string::npos) text.replace(at, 4, std::to_string(port));
        if (text == "FILE") text = folder.file("iridium.db");
        arguments.push_back(std::move(text));
    }
    program tested(with_descriptors(48, arguments));
    auto until = [](auto done) {
        auto limit = std::chrono::steady_clock::now() + 60s; // only what is broken takes that long
        while (!done() && std::chrono::steady_clock::now() < limit) std::this_thread::yield();
        return done();
    };
    REQUIRE(until([&] { return backlog(port) >= 0; }));
    asio::io_context context;
    std::vector<asio::ip::tcp::socket> crowd;
    for (int i = 0; i < 100; ++i) {
        crowd.emplace_back(context);
        crowd.back().connect(address(asio::ip::make_address("127.0.0.1"), port));
    }
    if (!one.answer.empty()) CHECK_THAT(ask(port, one.words, one.answer), Contains(one.answer));
    crowd.clear();
    CHECK(until([&] { return backlog(port) == 0; }));
    if (!one.answer.empty()) CHECK_THAT(ask(port, one.words, one.answer), Contains(one.answer));
    tested.signal(SIGTERM);
    CHECK(tested.wait().exit_code == 0);
}

TEST_CASE("host: out of file descriptors a provider on a local socket accepts again when there are some") {
    scratch_folder folder;
    auto file = folder.file("vessel.sock");
    program vessel(with_descriptors(48, vessel_at("local://" + file)));
    auto at = vessel.read_line();
    asio::io_context context;
    std::vector<asio::local::stream_protocol::socket> strangers;
    for (int i = 0; i < 100; ++i) {
        strangers.emplace_back(context);
        strangers.back().connect(asio::local::stream_protocol::endpoint(file));
    }
    CHECK(run_program(ise_call(at, "nap", R"({"milliseconds":0})")).exit_code == 0);
    vessel.signal(SIGTERM);
    auto ended = vessel.wait();
    CHECK(ended.exit_code == 0);
    CHECK_THAT(ended.err, Contains("Too many open files") && Contains("ulimit -n"));
}

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
        arguments = {"atirma", "run", "--name-server", "tcp://127.0.0.1:1", "web-server", "--address", "127.0.0.1",
                     "--port", port};
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
    CHECK_THAT(ran.err,
               Contains(port) && Contains("already in use") && Contains("ss -l") && Contains("use another endpoint"));
}

TEST_CASE("host: a full disk under what a program writes stops no service") {
    ise_test::start_options full;
    full.output_file = "/dev/full";
    console shore;
    program vessel({"/bin/sh", "-c", R"(exec "$0" "$@" 2>/dev/full)", ISE_BINARY_DIR "/bin/host_vessel", "-",
                    "tcp://127.0.0.1:0"});
    auto at = vessel.read_line();
    CHECK(shore.answer(shore.call(at, 0, 60s)));
    asio::io_context context;
    auto to = ise::endpoint::parse(at).value();
    asio::ip::tcp::socket stranger(context);
    stranger.connect({asio::ip::make_address(to.host), to.port});
    asio::write(stranger, asio::buffer(std::string(100, 'x'))); // something to log about
    CHECK(shore.answer(shore.call(at, 0, 60s)));
    auto call = ise_call(at, "nap", R"({"milliseconds":0})");
    auto result = run_program(call, full); // what was asked for cannot be told
    CHECK(result.exit_code != 0);
    INFO(result.err);
    CHECK_THAT(result.err, Contains("No space left"));
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
