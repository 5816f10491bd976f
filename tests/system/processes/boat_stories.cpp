// The whole slice as its users run it: a process for each component, driven by `ise`.
#include <support/catch.hpp>
#include <support/program.hpp>

#include <fmt/format.h>

#include <csignal>
#include <filesystem>
#include <map>
#include <memory>
#include <unistd.h>

using ise_test::Contains;
using ise_test::program;
using ise_test::ran;
using ise_test::run_program;
using ise_test::start_options;

namespace {

// Everything of the demo. Each process is ended with it.
class demo {
public:
    demo() {
        std::filesystem::create_directory(folder_);
        auto listening = run("names", {"ise_name_server", "--listen", "tcp://127.0.0.1:0", "--fresh"});
        names_ = listening.substr(listening.find("tcp://"));
        commands_["names"] = {"ise_name_server", "--listen", names_};
        run("air", atirma("xbee-link", {"--shore-port", folder_ + "/shore", "--boat-port", folder_ + "/boat"}));
        run("boat", atirma("boat-simulator", {"--serial", folder_ + "/boat"}));
        run("xbee", atirma("xbee-proxy", {"--serial", folder_ + "/shore"}));
        // That the component is ready and that its page is come from two threads, in either order.
        auto line = run("page", atirma("web-server", {"--port", "0"}));
        if (line.find("http://") == std::string::npos) line = processes_["page"]->read_line();
        INFO(line);
        REQUIRE_THAT(line, Contains("http://"));
        page_ = line.substr(line.find("http://") + 7);
        page_.resize(page_.find('/'));
    }
    ~demo() {
        processes_.clear();
        std::filesystem::remove_all(folder_);
    }
    demo(const demo&) = delete;
    demo& operator=(const demo&) = delete;

    /// Starts it, also again, and gives the first line that it prints.
    std::string run(const std::string& name, std::vector<std::string> command) {
        commands_[name] = command;
        processes_[name].reset();
        processes_[name] = std::make_unique<program>(std::move(command), variables());
        auto line = processes_[name]->read_line();
        INFO(name << " says: " << line);
        REQUIRE_FALSE(line.empty());
        return line;
    }
    void kill(const std::string& name) {
        processes_.at(name)->signal(SIGKILL);
        processes_.at(name)->wait();
    }
    void run_again(const std::string& name) { run(name, commands_.at(name)); }
    ran end(const std::string& name) {
        processes_.at(name)->signal(SIGTERM);
        return processes_.at(name)->wait();
    }

    /// `ise`, which tries for a minute before it gives up.
    ran ise(std::vector<std::string> arguments) {
        arguments.insert(arguments.begin(), {"ise", "--wait", "--timeout", "60s"});
        return run_program(std::move(arguments), variables());
    }
    ran set_mode(int id, const std::string& mode) {
        return ise({"call", "atirma/shore/xbee", "telecommand",
                    fmt::format(R"({{"id":{},"command":{{"kind":"set_mode","mode":"{}"}}}})", id, mode)});
    }
    const std::string& page() const { return page_; }
    start_options variables() const {
        start_options made;
        if (!names_.empty()) made.variables = {{"ISE_NAME_SERVER", names_}};
        return made;
    }

private:
    std::vector<std::string> atirma(const std::string& type, std::vector<std::string> options) {
        std::vector<std::string> command{"atirma", "run", "--log-level", "error", type};
        command.insert(command.end(), options.begin(), options.end());
        return command;
    }

    // In a process namespace of its own the number alone may come again.
    std::string folder_ = fmt::format("{}/ise-test-{}-{:x}", std::filesystem::temp_directory_path().string(),
                                      ::getpid(), reinterpret_cast<std::uintptr_t>(this));
    std::string names_, page_;
    std::map<std::string, std::vector<std::string>> commands_;
    std::map<std::string, std::unique_ptr<program>> processes_;
};

} // namespace

TEST_CASE("processes: the boat answers a telecommand, its telemetry reaches the page, and each process ends as asked") {
    demo sails;
    auto result = sails.set_mode(11, "hold");
    CHECK(result.err == "");
    CHECK_THAT(result.out, Contains(R"("state":"acknowledged")") && Contains(R"("result":"done")"));
    auto truth = sails.ise({"echo", "--count", "2", "atirma/boat", "ground_truth"});
    CHECK_THAT(truth.out, Contains(R"("mode":"hold")"));
    // Ends with 0 only if the page's event stream brought telemetry and the boat acknowledged.
    auto observed = run_program({"atirma", "observe", "--for", "12", "--page", sails.page()}, sails.variables());
    INFO(observed.out << observed.err);
    CHECK(observed.exit_code == 0);
    for (const char* name : {"page", "xbee", "boat", "air", "names"}) {
        INFO(name);
        CHECK(sails.end(name).exit_code == 0);
    }
}

TEST_CASE("processes: a killed proxy, boat, link or name server heals once it runs again") {
    auto victim = GENERATE(as<std::string>(), "xbee", "boat", "air", "names");
    INFO(victim);
    demo sails;
    REQUIRE_THAT(sails.set_mode(21, "hold").out, Contains(R"("state":"acknowledged")"));
    sails.kill(victim);
    sails.run_again(victim);
    // The id is new: the boat that comes back may not know what was said before, a proxy neither.
    auto result = sails.set_mode(22, "automatic");
    CHECK(result.err == "");
    CHECK_THAT(result.out, Contains(R"("state":"acknowledged")"));
    CHECK_THAT(sails.ise({"echo", "--count", "2", "atirma/boat", "ground_truth"}).out,
               Contains(R"("mode":"automatic")"));
}

TEST_CASE("processes: without the name server those who know each other go on, and say so to who asks for a name") {
    demo sails;
    REQUIRE_THAT(sails.set_mode(31, "hold").out, Contains(R"("state":"acknowledged")"));
    sails.kill("names");
    auto listed = run_program({"ise", "list"}, sails.variables());
    CHECK(listed.exit_code != 0);
    CHECK_THAT(listed.err, Contains("no name server") && Contains("ise_name_server"));
    sails.run_again("names");
    CHECK_THAT(sails.ise({"describe", "atirma/boat"}).out, Contains("ground_truth"));
}

TEST_CASE("processes: who listens is told when the boat is not reached any more, and hears it again when it is") {
    demo sails;
    program echo({"ise", "echo", "atirma/boat", "ground_truth"}, sails.variables());
    REQUIRE_FALSE(echo.read_line().empty());
    sails.kill("boat");
    CHECK_THAT(echo.read_error_line(), Contains("'atirma/boat' is no longer reachable"));
    sails.run_again("boat");
    auto result = echo.read_error_line() + "\n" + echo.read_error_line(); // in either order
    CHECK_THAT(result, Contains("is reached again") && Contains("the provider restarted"));
    echo.signal(SIGINT);
    CHECK(echo.wait().exit_code == 0);
}

TEST_CASE("processes: what a terminal would obey in the text of a failure is escaped") {
    const std::string hostile = "x\x1b[2J\x9b"; // clears the screen, and begins another such sequence
    for (auto ran : {ise_test::run_program({"atirma", "run", "--name-server", "tcp://" + hostile, "boat-simulator"}),
                     ise_test::run_program({"atirma_mission", "--out", hostile + "/", "--store", "a", "b",
                                            "--boat-memory", "c", "--name-server", hostile})}) {
        CHECK(ran.exit_code != 0);
        CHECK_THAT(ran.err, Contains("x [2J\\x9b") && !Contains("\x1b") && !Contains("\x9b"));
    }
}

TEST_CASE("processes: a type that does not exist is told with those that do") {
    auto ran = ise_test::run_program({"atirma", "run", "boat"});
    CHECK(ran.exit_code == 2);
    CHECK_THAT(ran.err, Contains("there is no component type 'boat'; there are") && Contains("boat-simulator"));
}
