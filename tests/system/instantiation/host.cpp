#include "host.hpp"

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <test_folders.hpp>
#include <unistd.h>

namespace host_test {

namespace {

// Empty where the file is gone; so is one of a process that ends while it is read.
std::string content_of(const std::filesystem::path& file) {
    std::ifstream from(file, std::ios::binary);
    std::ostringstream content;
    content << from.rdbuf();
    return std::move(content).str();
}

std::vector<int> processes() {
    std::vector<int> all;
    for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
        auto name = entry.path().filename().string();
        if (name.find_first_not_of("0123456789") == std::string::npos) all.push_back(std::stoi(name));
    }
    return all;
}

} // namespace

host::host() {
    std::string pattern = (std::filesystem::temp_directory_path() / "ise-host-XXXXXX").string();
    if (!::mkdtemp(pattern.data())) throw std::runtime_error("no temporary folder");
    folder_ = pattern;
    std::filesystem::create_directories(programs());
    install("ise_trouble");
    names_ = std::make_unique<ise_test::program>(std::vector<std::string>{
        "ise_name_server", "--listen", "tcp://127.0.0.1:0", "--fresh", "--log-level", "error"});
    auto line = names_->read_line();
    name_server_ = line.substr(line.find("tcp://"));
}

host::~host() {
    if (server_) close();
    for (int pid : marked()) ::kill(pid, SIGKILL);
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
}

void host::install(const std::string& name) {
    std::filesystem::create_symlink(std::string(ISE_BINARY_DIR "/bin/") + name, programs() / name);
}

void host::open(std::vector<std::string> options) {
    boot(std::move(options));
    auto there = ise({"--wait", "--timeout", "60s", "describe", "--names", "ise/host/shore"});
    INFO(there.err);
    REQUIRE(there.exit_code == 0);
}

void host::boot(std::vector<std::string> options) {
    std::vector<std::string> words{"ise_instantiation_server",
                                   "--programs",
                                   programs().string(),
                                   "--state",
                                   state_folder().string(),
                                   "--name",
                                   "shore",
                                   "--name-server",
                                   name_server_};
    words.insert(words.end(), options.begin(), options.end());
    if (!std::getenv("ISE_TEST_LOG")) words.insert(words.end(), {"--log-level", "error"});
    server_ = std::make_unique<ise_test::program>(words);
    auto line = server_->read_line();
    INFO(line);
    REQUIRE(line.find("ise/host/shore") != std::string::npos);
}

void host::crash() {
    server_->signal(SIGKILL);
    server_->wait();
    server_.reset();
}

int host::close() {
    server_->signal(SIGTERM);
    auto ran = server_->wait();
    server_.reset();
    UNSCOPED_INFO(ran.err);
    return ran.exit_code;
}

ise_test::ran host::ise(std::vector<std::string> words) {
    words.insert(words.begin(), {"ise", "--name-server", name_server_});
    return ise_test::run_program(std::move(words));
}

json host::json_of(std::vector<std::string> words) {
    words.push_back("--json");
    auto ran = ise(std::move(words));
    INFO(ran.err);
    REQUIRE(ran.exit_code == 0);
    return json::parse(ran.out);
}

json host::start(const std::string& path, std::vector<std::string> more) {
    std::vector<std::string> words{"start", "trouble", path, "--timeout", "120s", "--ready-within", "60s"};
    words.insert(words.end(), more.begin(), more.end());
    return json_of(std::move(words));
}

void host::deafen(const std::string& path) {
    wait_until([&] { return ise({"logs", path}).out.find("started: ") != std::string::npos; });
    json_of({"call", path, "deafen"});
}

json host::state(const std::string& path) {
    for (auto& one : json_of({"ps", path}))
        if (one["path"] == path) return one;
    FAIL("there is no instance " << path);
    return {};
}

namespace {

ise::node_options talks_to(const std::string& name_server) {
    ise::node_options options;
    options.name_servers = {ise::endpoint::parse(name_server).value()};
    options.log = {};
    return options;
}

template <class Stream>
ise::task<> subscribe(ise::component& self, std::shared_ptr<Stream> into) {
    auto server = co_await self.find("ise/host/shore", std::chrono::minutes(5));
    *into = co_await server.subscribe(ise::instantiation::services::events);
}

template <class Stream>
ise::task<ise::instantiation::instance_info> next(std::shared_ptr<Stream> from) {
    auto packet = co_await from->next();
    if (!packet) throw std::runtime_error("the instantiation server has gone");
    co_return packet->instance;
}

template <class Stream>
ise::task<> leave(std::shared_ptr<Stream> from) {
    *from = Stream();
    co_return;
}

} // namespace

event_watch::event_watch(const host& of) : node_(env_, talks_to(of.name_server())) {
    self_ = &node_.start("", [](ise::component&) -> ise::task<> { co_return; });
    self_->wait(subscribe(*self_, events_));
}

event_watch::~event_watch() { self_->wait(leave(events_)); } // on its own loop

ise::instantiation::instance_info event_watch::until(const std::string& path,
                                                     ise::instantiation::instance_state state) {
    for (;;) {
        auto result = self_->wait(next(events_));
        if (result.path == path && result.state == state) return result;
    }
}

void send_signal(int pid, int number) {
    if (pid <= 1) FAIL("signal " << number << " for process " << pid);
    ::kill(pid, number);
}

bool lives(int pid) {
    auto stat = content_of("/proc/" + std::to_string(pid) + "/stat");
    auto end = stat.rfind(')');
    return end != std::string::npos && stat.size() > end + 2 && stat[end + 2] != 'Z' && stat[end + 2] != 'X';
}

int keeper_of(int pid) {
    auto stat = content_of("/proc/" + std::to_string(pid) + "/stat"); // "PID (NAME) STATE PARENT …"
    return std::stoi(stat.substr(stat.rfind(')') + 4));
}

int zombies() {
    int count = 0;
    if (!std::getenv("ISE_IN_PID_NAMESPACE")) return count; // those of others are not ours to judge
    for (int pid : processes()) {
        auto stat = content_of("/proc/" + std::to_string(pid) + "/stat");
        auto end = stat.rfind(')');
        if (end != std::string::npos && stat.size() > end + 2 && stat[end + 2] == 'Z') ++count;
    }
    return count;
}

std::vector<int> marked() {
    std::vector<int> found;
    for (int pid : processes())
        if (pid > 1 && lives(pid) &&
            content_of("/proc/" + std::to_string(pid) + "/environ").find("ISE_INSTANCE=") != std::string::npos)
            found.push_back(pid);
    return found;
}

} // namespace host_test
