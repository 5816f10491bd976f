// environment-boundary: what an instantiation server does to its host is done here
#include <ise/instantiation/cgroup.hpp>

#include <ise/instantiation/process_table.hpp>

#include <fmt/format.h>

#include <cstdio>
#include <ctime>
#include <sstream>

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise::instantiation {
namespace {

constexpr const char* server_group = "ise-server";
constexpr const char* instance_prefix = "ise-";

bool write_control(const std::string& file, std::string_view text) {
    file_handle to(::open(file.c_str(), O_WRONLY | O_CLOEXEC));
    return to && ::write(to.get(), text.data(), text.size()) == static_cast<ssize_t>(text.size());
}

std::string mount_point() {
    std::istringstream lines(content_of_file("/proc/self/mountinfo", 1 << 20));
    std::string line;
    while (std::getline(lines, line)) {
        auto separator = line.find(" - cgroup2 ");
        if (separator == std::string::npos) continue;
        std::istringstream words(line);
        std::string number, parent, device, root, where;
        words >> number >> parent >> device >> root >> where;
        return root == "/" ? where : std::string(); // a part of the tree that is mounted elsewhere has other paths
    }
    return {};
}

std::string own_group() {
    std::istringstream lines(content_of_file("/proc/self/cgroup", 1 << 16));
    std::string line;
    while (std::getline(lines, line))
        if (line.starts_with("0::/")) return line.substr(3);
    return {};
}

bool has_word(const std::string& text, std::string_view wanted) {
    std::istringstream words(text);
    std::string word;
    while (words >> word)
        if (word == wanted) return true;
    return false;
}

// Controllers can be enabled for the groups below only where no process is in the group itself, but for the root of
// all.
void enable_controllers(const std::string& base, bool is_root) {
    auto there = content_of_file(base + "/cgroup.controllers", 4096);
    bool any = has_word(there, "pids") || has_word(there, "memory") || has_word(there, "cpu");
    if (!any) return;
    auto below = base + "/" + server_group;
    bool moved = false;
    if (!is_root && has_word(content_of_file(base + "/cgroup.procs", 1 << 20), fmt::format("{}", ::getpid()))) {
        if (::mkdir(below.c_str(), 0755) != 0 && errno != EEXIST) return;
        moved = write_control(below + "/cgroup.procs", "0");
    }
    bool enabled = false;
    for (const char* one : {"+pids", "+memory", "+cpu"})
        enabled = write_control(base + "/cgroup.subtree_control", one) || enabled;
    if (enabled || !moved) return;
    write_control(base + "/cgroup.procs", "0"); // others are in it: as it was
    ::rmdir(below.c_str());
}

// Those of keepers that were killed; one that was just made may not have its process yet.
void remove_abandoned(const std::string& base) {
    constexpr std::time_t grown_old_s = 60;
    auto* folder = ::opendir(base.c_str());
    if (!folder) return;
    while (const auto* entry = ::readdir(folder)) {
        std::string_view name = entry->d_name;
        if (!name.starts_with(instance_prefix) || name == server_group) continue;
        auto path = fmt::format("{}/{}", base, name);
        struct stat about {};
        if (::stat(path.c_str(), &about) == 0 && about.st_mtim.tv_sec + grown_old_s < ::time(nullptr))
            ::rmdir(path.c_str()); // not while a process is in it
    }
    ::closedir(folder);
}

} // namespace

std::string usable_cgroup() {
    auto mounted = mount_point();
    auto own = own_group();
    if (mounted.empty() || own.empty()) return {};
    bool is_root = own == "/";
    auto base = is_root ? mounted : mounted + own;
    auto in_subgroup = fmt::format("/{}", server_group);
    if (base.ends_with(in_subgroup)) base.resize(base.size() - in_subgroup.size());
    auto trial = fmt::format("{}/{}trial-{}", base, instance_prefix, ::getpid());
    if (::mkdir(trial.c_str(), 0755) != 0) return {};
    bool can_kill = ::access((trial + "/cgroup.kill").c_str(), W_OK) == 0; // from Linux 5.14 on
    bool can_enter = ::access((base + "/cgroup.procs").c_str(), W_OK) == 0;
    ::rmdir(trial.c_str());
    if (!can_kill || !can_enter) return {};
    remove_abandoned(base);
    enable_controllers(base, is_root);
    return fmt::format("{}/{}", base, instance_prefix);
}

bool cgroup::open(const resource_limits& limits) {
    if (::mkdir(folder_.c_str(), 0755) != 0 && errno != EEXIST) return false;
    open_ = true;
    processes_ = folder_ + "/cgroup.procs";
    pids_ = write_control(folder_ + "/pids.max", fmt::format("{}", limits.pids));
    if (limits.memory != 0) {
        memory_ = write_control(folder_ + "/memory.max", fmt::format("{}", limits.memory));
        write_control(folder_ + "/memory.swap.max", "0");
        write_control(folder_ + "/memory.oom.group", "1");
    }
    constexpr double period_us = 100'000;
    if (limits.cpus != 0)
        cpus_ = write_control(folder_ + "/cpu.max", fmt::format("{:.0f} {:.0f}", limits.cpus * period_us, period_us));
    return true;
}

bool cgroup::enter() const noexcept {
    int to = ::open(processes_.c_str(), O_WRONLY | O_CLOEXEC);
    if (to < 0) return false;
    bool moved = ::write(to, "0", 1) == 1;
    ::close(to);
    return moved;
}

void cgroup::kill() const {
    if (open_) write_control(folder_ + "/cgroup.kill", "1");
}

bool cgroup::ran_out_of_memory() const {
    if (!memory_) return false;
    std::istringstream words(content_of_file(folder_ + "/memory.events", 4096));
    std::string name;
    std::uint64_t count = 0;
    while (words >> name >> count)
        if (name == "oom_kill" && count > 0) return true;
    return false;
}

void cgroup::close() {
    if (open_) ::rmdir(folder_.c_str());
    open_ = false;
}

} // namespace ise::instantiation
