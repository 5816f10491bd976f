// environment-boundary: what an instantiation server does to its host is done here
#include <ise/instantiation/process_table.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <deque>
#include <map>
#include <set>
#include <sstream>

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

namespace ise::instantiation {
namespace {

std::vector<std::int32_t> numbers_in_folder(const std::string& path) {
    std::vector<std::int32_t> found;
    auto* folder = ::opendir(path.c_str());
    if (!folder) return found;
    while (const auto* entry = ::readdir(folder)) {
        std::int32_t number = 0;
        auto* end = entry->d_name + std::strlen(entry->d_name);
        auto [stop, problem] = std::from_chars(entry->d_name, end, number);
        if (problem == std::errc() && stop == end) found.push_back(number);
    }
    ::closedir(folder);
    return found;
}

// False: the kernel keeps no such list (CONFIG_PROC_CHILDREN).
bool add_children(std::int32_t pid, std::vector<std::int32_t>& to) {
    for (auto thread : numbers_in_folder(fmt::format("/proc/{}/task", pid))) {
        auto file = fmt::format("/proc/{}/task/{}/children", pid, thread);
        auto text = content_of_file(file, std::size_t{1} << 20);
        if (text.empty() && ::access(file.c_str(), F_OK) != 0 &&
            ::access(fmt::format("/proc/{}/task/{}", pid, thread).c_str(), F_OK) == 0)
            return false;
        std::istringstream words(text);
        std::int32_t child = 0;
        while (words >> child) to.push_back(child);
    }
    return true;
}

void visit_by_parents(std::int32_t pid, const std::function<bool(const process_entry&)>& visit) {
    std::multimap<std::int32_t, process_entry> by_parent;
    for (auto one : numbers_in_folder("/proc"))
        if (auto result = look_up(one)) by_parent.emplace(result->parent, *result);
    std::deque<std::int32_t> open{pid};
    while (!open.empty()) {
        auto [from, to] = by_parent.equal_range(open.front());
        open.pop_front();
        for (; from != to; ++from) {
            if (!visit(from->second)) return;
            open.push_back(from->second.stamp.pid);
        }
    }
}

} // namespace

std::string content_of_file(const std::string& path, std::size_t most) {
    file_handle file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    std::string text;
    std::array<char, 4096> piece;
    while (file && text.size() < most) {
        auto got = ::read(file.get(), piece.data(), piece.size());
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) break;
        text.append(piece.data(), static_cast<std::size_t>(got));
    }
    return text;
}

file_handle::~file_handle() {
    if (number_ >= 0) ::close(number_);
}

std::string process_end::text() const {
    if (!reason.empty()) return reason;
    if (!known)
        return "killed or crashed, it seems: its keeper process was killed and left no record of it (see `ise logs`)";
    if (by_signal) return fmt::format("signal {} ({})", number, ::strsignal(number));
    return fmt::format("exit code {}", number);
}

std::optional<process_entry> look_up(std::int32_t pid) {
    if (pid <= 0) return {};
    auto text = content_of_file(fmt::format("/proc/{}/stat", pid), 4096);
    auto name_end = text.rfind(')'); // the name may hold anything
    if (name_end == std::string::npos) return {};
    process_entry made;
    made.stamp.pid = pid;
    char state = 0;
    int parent = 0;
    unsigned long long start = 0;
    int group = 0;
    // state ppid pgrp session tty tpgid flags minflt cminflt majflt cmajflt utime stime cutime cstime priority nice
    // threads itreal start vsize rss
    unsigned threads = 0;
    long long pages = 0;
    int got = std::sscanf(text.c_str() + name_end + 1,
                          " %c %d %d %*d %*d %*d %*u %*u %*u %*u %*u %*u %*u %*d %*d %*d %*d %u %*d %llu %*u %lld",
                          &state, &parent, &group, &threads, &start, &pages);
    if (got != 6) return {};
    made.parent = parent;
    made.group = group;
    made.threads = threads;
    made.resident_bytes =
        static_cast<std::uint64_t>(std::max(pages, 0LL)) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
    made.stamp.start_ticks = start;
    made.ended = state == 'Z' || state == 'X';
    return made;
}

bool carries_mark(std::int32_t pid, const std::string& mark, const char* variable) {
    if (pid <= 1 || mark.empty()) return false;
    auto variables = content_of_file(fmt::format("/proc/{}/environ", pid), std::size_t{4} << 20);
    auto wanted = fmt::format("{}={}", variable, mark);
    for (std::size_t at = 0; at < variables.size();) {
        auto end = std::min(variables.find('\0', at), variables.size());
        if (std::string_view(variables).substr(at, end - at) == wanted) return true;
        at = end + 1;
    }
    return false;
}

std::vector<process_entry> members_of(const process_stamp& leader, const std::string& mark) {
    std::vector<process_entry> found;
    auto head = look_up(leader.pid);
    // A number is not given away while its group has members.
    bool group_is_its = leader.pid > 1 && (!head || head->stamp == leader);
    for (auto pid : numbers_in_folder("/proc")) {
        if (pid <= 1 || pid == ::getpid()) continue;
        auto result = look_up(pid);
        if (!result || result->ended) continue;
        bool in_group = group_is_its && result->group == leader.pid && result->stamp.start_ticks >= leader.start_ticks;
        if (in_group || carries_mark(pid, mark)) found.push_back(*result);
    }
    std::ranges::sort(found, {},
                      [](const process_entry& one) { return std::pair(one.stamp.start_ticks, one.stamp.pid); });
    return found;
}

std::vector<process_entry> descendants_of(std::int32_t pid) {
    std::vector<process_entry> found;
    visit_descendants(pid, [&found](const process_entry& one) {
        found.push_back(one);
        return true;
    });
    return found;
}

void visit_descendants(std::int32_t pid, const std::function<bool(const process_entry&)>& visit) {
    std::set<std::int32_t> seen;
    std::deque<std::int32_t> open{pid};
    while (!open.empty()) {
        auto next = open.front();
        open.pop_front();
        std::vector<std::int32_t> children;
        if (!add_children(next, children)) return visit_by_parents(pid, visit);
        for (auto child : children) {
            if (!seen.insert(child).second) continue; // its parent ended meanwhile
            auto result = look_up(child);
            if (!result) continue;
            if (!visit(*result)) return;
            open.push_back(child);
        }
    }
}

std::optional<process_entry> find_keeper(const std::string& mark) {
    for (auto pid : numbers_in_folder("/proc"))
        if (carries_mark(pid, mark, keeper_variable))
            if (auto result = look_up(pid); result && !result->ended) return result;
    return {};
}

std::uint64_t threads_of_user(std::uint32_t user) {
    std::uint64_t count = 0;
    for (auto pid : numbers_in_folder("/proc")) {
        struct stat about {};
        if (::stat(fmt::format("/proc/{}", pid).c_str(), &about) != 0 || about.st_uid != user) continue;
        if (auto result = look_up(pid)) count += result->threads;
    }
    return count;
}

file_handle open_process(const process_stamp& who) {
    if (who.pid <= 1) return file_handle();
    file_handle made(static_cast<int>(::syscall(SYS_pidfd_open, who.pid, 0)));
    if (!made) return made;
    auto now = look_up(who.pid); // looked at behind the handle: it is this one, or the handle is of a dead one
    return now && now->stamp == who ? std::move(made) : file_handle();
}

void send_signal(const process_stamp& who, int number) {
    auto target = open_process(who);
    if (target) ::syscall(SYS_pidfd_send_signal, target.get(), number, nullptr, 0);
}

void send_signal_to_group(const process_stamp& leader, int number) {
    auto head = look_up(leader.pid);
    if (leader.pid <= 1 || !head || !(head->stamp == leader)) return;
    ::kill(-leader.pid, number); // NOLINT(environment): as above
}

process_end reap(std::int32_t pid, bool wait) {
    int status = 0;
    if (pid <= 1 || ::waitpid(pid, &status, wait ? 0 : WNOHANG) != pid) return {};
    return end_of_status(status);
}

process_end end_of_status(int status) {
    process_end end;
    end.known = true;
    end.by_signal = WIFSIGNALED(status);
    end.number = end.by_signal ? WTERMSIG(status) : WEXITSTATUS(status);
    return end;
}

} // namespace ise::instantiation
