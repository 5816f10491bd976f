// Two communication nodes as processes of their own, with a boat and a radio: killed in turn.
#include <support/catch.hpp>
#include <support/program.hpp>

#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <map>
#include <memory>
#include <regex>
#include <set>
#include <unistd.h>

using Catch::Contains;
using ise_test::program;
using ise_test::ran;
using ise_test::run_program;
using ise_test::start_options;

namespace {

class deployment {
public:
    deployment() {
        std::filesystem::create_directory(folder_);
        auto listening = run("names", {"ise_name_server", "--listen", "tcp://127.0.0.1:0", "--fresh"});
        names_ = listening.substr(listening.find("tcp://"));
        run("air", atirma("xbee-link", {"--shore-port", folder_ + "/shore", "--boat-port", folder_ + "/boat"}));
        run("boat", atirma("boat-simulator", {"--serial", folder_ + "/boat"}));
        run("xbee", atirma("xbee-proxy", {"--serial", folder_ + "/shore"}));
        run("one", atirma("communication-node", node("one", "two")));
        auto second = node("two", "one");
        second.push_back("--secondary");
        run("two", atirma("communication-node", second));
    }
    ~deployment() {
        processes_.clear();
        std::filesystem::remove_all(folder_);
    }
    deployment(const deployment&) = delete;
    deployment& operator=(const deployment&) = delete;

    void run_again(const std::string& name) { run(name, commands_.at(name)); }
    void kill(const std::string& name) {
        processes_.at(name)->signal(SIGKILL);
        processes_.at(name)->wait();
    }
    ran end(const std::string& name) {
        processes_.at(name)->signal(SIGTERM);
        return processes_.at(name)->wait();
    }
    ran call(const std::string& whom, const std::string& service, const std::string& request) {
        start_options variables;
        variables.variables = {{"ISE_NAME_SERVER", names_}};
        return run_program({"ise", "--wait", "--timeout", "60s", "call", whom, service, request}, variables);
    }
    ran set_mode(int id, const std::string& mode) {
        return call("atirma/communication", "telecommand",
                    fmt::format(R"({{"id":{},"command":{{"kind":"set_mode","mode":"{}"}}}})", id, mode));
    }
    // Of the packets on that node's disk that it shows.
    std::multiset<std::string> track(const std::string& name) {
        auto told = call("atirma/shore/" + name, "track", R"({"max_packets":1000})");
        INFO(told.err);
        REQUIRE(told.exit_code == 0);
        std::multiset<std::string> made;
        std::regex number(R"re("boot":\d+,"sequence":\d+)re");
        for (std::sregex_iterator at(told.out.begin(), told.out.end(), number), last; at != last; ++at)
            made.insert(at->str());
        return made;
    }
    // What the node says of itself next.
    std::string state(const std::string& name) {
        start_options variables;
        variables.variables = {{"ISE_NAME_SERVER", names_}};
        return run_program({"ise", "--wait", "--timeout", "60s", "echo", "--count", "1", "atirma/shore/" + name,
                            "communication_state"},
                           variables)
            .out;
    }
    bool until(const std::function<bool()>& done) {
        auto limit = std::chrono::steady_clock::now() + std::chrono::minutes(2); // only what is broken takes that long
        while (!done())
            if (std::chrono::steady_clock::now() > limit) return false;
        return true;
    }

private:
    std::string run(const std::string& name, std::vector<std::string> command) {
        commands_[name] = command;
        processes_[name].reset();
        start_options variables;
        if (!names_.empty()) variables.variables = {{"ISE_NAME_SERVER", names_}};
        processes_[name] = std::make_unique<program>(std::move(command), variables);
        auto line = processes_[name]->read_line();
        INFO(name << " says: " << line);
        REQUIRE_FALSE(line.empty());
        return line;
    }
    std::vector<std::string> atirma(const std::string& type, std::vector<std::string> options) {
        std::vector<std::string> command{"atirma", "run", "--log-level", "error", type};
        command.insert(command.end(), options.begin(), options.end());
        return command;
    }
    std::vector<std::string> node(const std::string& name, const std::string& peer) {
        return {"--path", "atirma/shore/" + name,       "--peer",  "atirma/shore/" + peer,
                "--file", folder_ + "/" + name + ".db", "--proxy", "xbee=atirma/shore/xbee"};
    }

    std::string folder_ = fmt::format("{}/ise-nodes-{}-{:x}", std::filesystem::temp_directory_path().string(),
                                      ::getpid(), reinterpret_cast<std::uintptr_t>(this));
    std::string names_;
    std::map<std::string, std::vector<std::string>> commands_;
    std::map<std::string, std::unique_ptr<program>> processes_;
};

} // namespace

TEST_CASE(
    "processes: communication nodes are killed in turn, telecommands go on, and both have everything in the end") {
    deployment it;
    auto refused = it.set_mode(1, "hold");
    CHECK(refused.exit_code != 0);
    CHECK_THAT(refused.err, Contains("nobody holds the authority"));
    auto taken = it.call("atirma/communication", "authority", R"({"action":"take"})");
    INFO(taken.err);
    CHECK_THAT(taken.out, Contains(R"("holder":"anonymous@)"));
    CHECK_THAT(it.set_mode(2, "hold").out, Contains(R"("state":"acknowledged")"));
    int id = 10;
    for (const char* victim : {"one", "two", "one"}) {
        INFO(victim);
        it.kill(victim);
        ++id;
        auto mode = std::string(id % 2 ? "automatic" : "hold");
        auto told = it.set_mode(id, mode);
        // A call that was written to the node that died is not sent again by itself: the operator asks with the same id.
        auto acknowledged = [&] { return told.out.find(R"("state":"acknowledged")") != std::string::npos; };
        for (int tries = 0; tries < 20 && !acknowledged(); ++tries) told = it.set_mode(id, mode);
        INFO(told.err);
        CHECK_THAT(told.out, Contains(R"("state":"acknowledged")") && Contains(R"("result":"done")"));
        it.run_again(victim);
        REQUIRE(it.until([&] { return it.state(victim).find(R"("serving":true)") != std::string::npos; }));
        REQUIRE(it.until([&] {
            return it.state("one").find(R"("peer_lives":true)") != std::string::npos &&
                   it.state("two").find(R"("peer_lives":true)") != std::string::npos;
        }));
    }
    it.end("boat");
    std::multiset<std::string> one, two;
    REQUIRE(it.until([&] {
        one = it.track("one");
        two = it.track("two");
        return one == two && one.size() >= 20;
    }));
    CHECK(std::set<std::string>(one.begin(), one.end()).size() == one.size()); // none twice
    auto record = it.call("atirma/shore/two", "telecommand_record", "{}");
    for (int known : {2, 11, 12, 13}) CHECK_THAT(record.out, Contains(fmt::format(R"("id":{},)", known)));
    for (const char* name : {"one", "two"}) CHECK(it.end(name).exit_code == 0);
}
