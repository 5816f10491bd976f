// A short mission on the real clock, with everything of it in processes, by the script that people start.
#include <support/catch.hpp>
#include <support/program.hpp>

#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>
#include <fmt/format.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <poll.h>
#include <sstream>
#include <sys/syscall.h>
#include <test_folders.hpp>
#include <unistd.h>
#include <utility>
#include <vector>

using ise_test::Contains;

namespace {

struct folder {
    std::filesystem::path at;
    folder() { // a process id is not one of its own: other tests run in namespaces of theirs
        auto name = (std::filesystem::temp_directory_path() / "ise-mission-XXXXXX").string();
        REQUIRE(::mkdtemp(name.data()));
        at = name;
    }
    ~folder() { std::filesystem::remove_all(at); }
    std::string read(const std::string& name) const {
        std::ifstream in(at / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
};

ise_test::ran run_demo(std::vector<std::string> options) {
    std::vector<std::string> command{ISE_SOURCE_DIR "/apps/demo"};
    command.insert(command.end(), options.begin(), options.end());
    ise_test::start_options how;
    how.variables = {{"ATIRMA_BIN", ISE_BINARY_DIR "/bin"}};
    return ise_test::run_program(std::move(command), how);
}

// A process of somebody else's, held so that its number means no other.
class process {
public:
    explicit process(long pid) : held_(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0))) {}
    process(process&& from) noexcept : held_(std::exchange(from.held_, -1)) {}
    ~process() {
        if (held_ >= 0) ::close(held_);
    }
    bool ends() const {
        pollfd one{held_, POLLIN, 0};
        return held_ < 0 || ::poll(&one, 1, 60'000) == 1;
    }

private:
    int held_;
};

std::vector<process> started_with(const std::string& variable) {
    std::vector<process> found;
    for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
        auto name = entry.path().filename().string();
        if (name.find_first_not_of("0123456789") != std::string::npos) continue;
        std::ifstream in(entry.path() / "environ", std::ios::binary);
        std::ostringstream all; // does not throw where the process ends meanwhile
        all << in.rdbuf();
        if (all.str().find(variable + '\0') != std::string::npos) found.emplace_back(std::stol(name));
    }
    return found;
}

} // namespace

TEST_CASE("demo: a minute's mission on the real clock, with links and processes failing, loses nothing") {
    folder out;
    auto result = run_demo({"--mission", "stress", "--for", "60s", "--seed", "3", "--speedup", "4", "--port", "0",
                            "--out", out.at.string()});
    INFO(result.out);
    INFO(result.err);
    INFO(out.read("report.md"));
    CHECK(result.exit_code == 0);
    CHECK_THAT(result.out, Contains("the proof holds"));
    CHECK_THAT(out.read("report.md"), Contains("on the real clock") && Contains("**The proof holds") &&
                                          Contains("the primary communication node is killed") &&
                                          Contains("the boat's computer loses its power"));
    if (std::filesystem::exists(ISE_BINARY_DIR "/bin/atirma_window_operator")) {
        CHECK_THAT(out.read("report.md"), Contains("carla's window at the end: "));
        CHECK(out.read("david.png").size() > 10'000);
    }
    CHECK_THAT(out.read("track.svg"), Contains("</svg>"));
    CHECK_THAT(out.read("track.gpx"), Contains("<trkpt"));
}

TEST_CASE("demo: a minute's mission whose nodes share a PostgreSQL that crashes and is stopped loses nothing") {
    if (!std::filesystem::exists("/usr/lib/postgresql")) return ise_test::skip("PostgreSQL is not installed");
    folder out;
    auto result = run_demo({"--mission", "stress", "--store", "postgresql", "--for", "60s", "--seed", "3", "--speedup",
                            "4", "--port", "0", "--out", out.at.string()});
    INFO(result.out);
    INFO(result.err);
    INFO(out.read("report.md"));
    CHECK(result.exit_code == 0);
    CHECK_THAT(result.out, Contains("the proof holds"));
    CHECK_THAT(out.read("report.md"), Contains("must be in the database") &&
                                          Contains("the nodes' database server crashes") &&
                                          Contains("the nodes' database server is stopped"));
}

TEST_CASE("demo: what keeps it from starting is told at once, with the word of the process that knows why") {
    folder in;
    std::ofstream(in.at / "bad.csv") << "t_s,tws_mps,twd_deg\n0,6,40\n10,x,50\n";
    auto wind = run_demo({"--wind", (in.at / "bad.csv").string(), "--port", "0"});
    CHECK(wind.exit_code == 1);
    CHECK_THAT(wind.err, Contains("atirma/boat") && Contains("bad.csv:3") && !Contains("--- server-of-"));
    CHECK_THAT(wind.out, !Contains("The boat sails"));

    asio::io_context context;
    asio::ip::tcp::acceptor taken(context, {asio::ip::address_v4::loopback(), 0});
    auto port = run_demo({"--port", fmt::to_string(taken.local_endpoint().port())});
    CHECK(port.exit_code == 1);
    CHECK_THAT(port.err, Contains("is in use already") && Contains("--port 0"));
}

TEST_CASE("demo: a script that is killed takes its processes along, and the next one its folder") {
    folder in;
    ise_test::start_options how;
    how.variables = {{"ATIRMA_BIN", ISE_BINARY_DIR "/bin"}, {"TMPDIR", in.at.string()}};
    ise_test::program killed({ISE_SOURCE_DIR "/apps/demo", "--port", "0"}, how);
    int blanks = 0; // one is of its text, two are its end
    for (std::string line; line != "Ctrl-C ends it.";) {
        line = killed.read_line();
        blanks = line.empty() ? blanks + 1 : 0;
        if (blanks > 1) FAIL("the demo did not start: " << killed.wait().err);
    }
    auto left_behind = std::filesystem::directory_iterator(in.at)->path();
    auto processes = started_with("TMPDIR=" + in.at.string());
    CHECK(processes.size() > 10);
    killed.signal(SIGKILL);
    CHECK(killed.wait().exit_code == 128 + SIGKILL);
    for (const auto& one : processes) CHECK(one.ends());

    REQUIRE(std::filesystem::exists(left_behind));
    auto next = ise_test::run_program({ISE_SOURCE_DIR "/apps/demo", "--for", "5s", "--port", "0"}, how);
    INFO(next.err);
    CHECK_FALSE(std::filesystem::exists(left_behind));
    CHECK(std::filesystem::is_empty(in.at));
}

TEST_CASE("demo: a mission's arguments are refused with a word that says which") {
    CHECK(run_demo({"--mission", "picnic"}).exit_code == 2);
    CHECK_THAT(run_demo({"--mission", "stress", "--for", "20s"}).err, Contains("a minute at least"));
    CHECK_THAT(run_demo({"--seed", "3"}).err, Contains("belong to --mission"));
    CHECK_THAT(run_demo({"--help"}).out, Contains("--mission stress"));
}
