// A host with a name server, an instantiation server and the command line, all of them processes.
#pragma once
#include <ise/instantiation/services.hpp>
#include <ise/ise.hpp>

#include <support/catch.hpp>
#include <support/program.hpp>

#include <nlohmann/json.hpp>

#include <csignal>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace host_test {

using nlohmann::json;

class host {
public:
    host();
    ~host();
    host(const host&) = delete;
    host& operator=(const host&) = delete;

    /// Starts its instantiation server; the one before must have ended.
    void open(std::vector<std::string> options = {});
    /// The same without waiting until it has taken over what runs.
    void boot(std::vector<std::string> options = {});
    /// kill -9 of it.
    void crash();
    /// Asks it to end, and waits: its exit code.
    int close();

    ise_test::ran ise(std::vector<std::string> words);
    /// What a command that must succeed tells with --json.
    json json_of(std::vector<std::string> words);
    /// Starts a `trouble` at a path: what is told of it.
    json start(const std::string& path, std::vector<std::string> more = {});
    json state(const std::string& path);
    /// Makes a `trouble` deaf to SIGTERM.
    void deafen(const std::string& path);
    std::filesystem::path programs() const { return folder_ / "programs"; }
    std::filesystem::path state_folder() const { return folder_ / "state"; }
    void install(const std::string& name);
    const std::string& name_server() const { return name_server_; }

private:
    std::filesystem::path folder_;
    std::string name_server_;
    std::unique_ptr<ise_test::program> names_, server_;
};

/// What the instantiation server tells, from when this was made.
class event_watch {
public:
    explicit event_watch(const host& of);
    ~event_watch();

    /// The next event of the instance at `path` in that state.
    ise::instantiation::instance_info until(const std::string& path, ise::instantiation::instance_state state);

private:
    using stream = ise::subscriber<std::remove_const_t<decltype(ise::instantiation::services::events)>>;

    ise::real_environment env_;
    ise::node node_;
    ise::component* self_ = nullptr;
    std::shared_ptr<stream> events_ = std::make_shared<stream>();
};

/// Sends a signal to one process; fails the test for a number below 2, since that of a process that is not there, -1,
/// means every process of the machine.
void send_signal(int pid, int number);
/// Whether a process lives, and is no zombie.
bool lives(int pid);
/// The keeper of an instance's process, which ends after it, and records how it ended.
int keeper_of(int pid);
/// Processes that carry the mark of an instance.
std::vector<int> marked();
/// Processes that have ended and that nobody has asked how.
int zombies();
/// Waits as long as it takes, looking again and again.
template <class Condition>
void wait_until(Condition holds) {
    while (!holds()) ::usleep(5000); // NOLINT: the system tells nobody when a process of others ends
}

} // namespace host_test
