#include "two_hosts.hpp"

#include <system/instantiation/host.hpp>

#include <fmt/format.h>

#include <cstdlib>
#include <fstream>
#include <test_folders.hpp>

namespace deployment_test {

two_hosts::two_hosts(const networks* apart) : apart_(apart) {
    if (apart_) name_server_ = "tcp://" + networks::address("boat") + ":0";
    std::string pattern = (std::filesystem::temp_directory_path() / "ise-hosts-XXXXXX").string();
    if (!::mkdtemp(pattern.data())) throw std::runtime_error("no temporary folder");
    folder_ = pattern;
    std::filesystem::create_directories(folder_ / "programs");
    std::filesystem::create_directories(folder_ / "ports");
    install("ise_trouble");
    start_name_server();
    for (const char* host : {"boat", "shore"}) open(host);
}

two_hosts::~two_hosts() {
    for (auto& [host, server] : servers_) {
        if (!server) continue;
        server->signal(SIGTERM);
        server->wait();
    }
    for (int pid : host_test::marked())
        if (pid > 1) ::kill(pid, SIGKILL);
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
}

std::vector<std::string> two_hosts::on(const std::string& host, std::vector<std::string> words) const {
    if (!apart_) return words;
    words.front() = ISE_BINARY_DIR "/bin/" + words.front();
    auto all = apart_->inside(host);
    all.insert(all.end(), words.begin(), words.end());
    return all;
}

void two_hosts::install(const std::string& program) {
    std::filesystem::create_symlink(std::string(ISE_BINARY_DIR "/bin/") + program, folder_ / "programs" / program);
}

void two_hosts::start_name_server() {
    std::vector<std::string> words{"ise_name_server", "--listen", name_server_, "--log-level", "error"};
    if (name_server_.ends_with(":0")) words.push_back("--fresh");
    names_ = std::make_unique<ise_test::program>(on("boat", words));
    auto line = names_->read_line();
    INFO(line);
    REQUIRE(line.find("tcp://") != std::string::npos);
    name_server_ = line.substr(line.find("tcp://"));
}

void two_hosts::crash_name_server() {
    names_->signal(SIGKILL);
    names_->wait();
    names_.reset();
}

void two_hosts::open(const std::string& host) {
    std::vector<std::string> words{"ise_instantiation_server",
                                   "--programs",
                                   (folder_ / "programs").string(),
                                   "--state",
                                   (folder_ / ("state-" + host)).string(),
                                   "--name",
                                   host,
                                   "--name-server",
                                   name_server_,
                                   "--allow-path",
                                   (folder_ / "ports").string(),
                                   "--allow-host",
                                   "127.0.0.1"};
    for (const char* of_another_boat : {"127.0.0.2", "127.0.0.3"})
        words.insert(words.end(), {"--allow-host", of_another_boat, "--allow-address", of_another_boat});
    if (!std::getenv("ISE_TEST_LOG")) words.insert(words.end(), {"--log-level", "error"});
    if (apart_) {
        auto port = port_of(host);
        auto address = networks::address(host);
        words.insert(words.end(), {"--listen", fmt::format("tcp://127.0.0.1:{}", port), "--advertise",
                                   fmt::format("tcp://{}:{}", address, port), "--allow-address", address});
    }
    servers_[host] = std::make_unique<ise_test::program>(on(host, words));
    auto line = servers_[host]->read_line();
    INFO(line);
    REQUIRE(line.find("ise/host/" + host) != std::string::npos);
    done({"--wait", "--timeout", "60s", "describe", "--names", "ise/host/" + host});
}

void two_hosts::crash(const std::string& host) {
    servers_.at(host)->signal(SIGKILL);
    servers_.at(host)->wait();
    servers_[host].reset();
}

ise_test::ran two_hosts::ise(std::vector<std::string> words) {
    words.insert(words.begin(), {"ise", "--name-server", name_server_});
    return ise_test::run_program(on("shore", std::move(words)));
}

std::string two_hosts::done(std::vector<std::string> words) {
    auto ran = ise(std::move(words));
    INFO(ran.out << ran.err);
    REQUIRE(ran.exit_code == 0);
    return ran.out;
}

json two_hosts::json_of(std::vector<std::string> words) {
    words.push_back("--json");
    return json::parse(done(std::move(words)));
}

std::string two_hosts::up(const std::string& file, std::vector<std::string> more) {
    std::vector<std::string> words{"up", file};
    words.insert(words.end(), more.begin(), more.end());
    return done(std::move(words));
}

std::string two_hosts::file(const std::string& name, const std::string& text) {
    auto path = folder_ / name;
    std::ofstream(path) << text;
    return path.string();
}

json two_hosts::state(const std::string& path) {
    json found;
    for (auto& one : json_of({"ps", path}))
        if (one["path"] == path && (found.is_null() || one["process_id"] != 0)) found = one;
    return found;
}

bool two_hosts::is_ready(const std::string& path) {
    auto now = state(path);
    return !now.is_null() && now["state"] == "ready";
}

std::vector<std::string> two_hosts::left_behind() const {
    std::vector<std::string> found;
    for (const char* folder : {"ports", "state-boat", "state-shore"})
        for (const auto& entry : std::filesystem::directory_iterator(folder_ / folder)) {
            auto name = entry.path().filename().string();
            bool state = name == "state.json" || name == "state.json.spare" || name == "lock" || name == ".lock";
            bool database = name.find(".db") != std::string::npos; // what a component keeps is there for its next life
            if (!state && !database) found.push_back(name);
        }
    return found;
}

} // namespace deployment_test
