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

#include <dirent.h>
#include <fcntl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

namespace ise::instantiation {
namespace {

std::string whole_file(const std::string& path, std::size_t most) {
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

} // namespace

file_handle::~file_handle() {
    if (number_ >= 0) ::close(number_);
}

std::string process_end::text() const {
    if (!told.empty()) return told;
    if (!known) return "killed or crashed, it seems: it left no word of its exit code, and the instantiation server that had started it was gone (see `ise logs`)";
    if (by_signal) return fmt::format("signal {} ({})", number, ::strsignal(number));
    return fmt::format("exit code {}", number);
}

std::optional<process_entry> look_up(std::int32_t pid) {
    if (pid <= 0) return {};
    auto text = whole_file(fmt::format("/proc/{}/stat", pid), 4096);
    auto name_end = text.rfind(')'); // the name may hold anything
    if (name_end == std::string::npos) return {};
    process_entry made;
    made.stamp.pid = pid;
    char state = 0;
    int parent = 0;
    unsigned long long start = 0;
    int group = 0;
    // state ppid pgrp session tty tpgid flags minflt cminflt majflt cmajflt utime stime cutime cstime priority nice threads itreal start
    int got = std::sscanf(text.c_str() + name_end + 1, " %c %d %d %*d %*d %*d %*u %*u %*u %*u %*u %*u %*u %*d %*d %*d %*d %*d %*d %llu", &state, &parent, &group, &start);
    if (got != 4) return {};
    made.group = group;
    made.stamp.start_ticks = start;
    made.ended = state == 'Z' || state == 'X';
    return made;
}

bool carries_mark(std::int32_t pid, const std::string& mark) {
    if (pid <= 1 || mark.empty()) return false;
    auto variables = whole_file(fmt::format("/proc/{}/environ", pid), std::size_t{4} << 20);
    auto wanted = fmt::format("{}={}", mark_variable, mark);
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
    bool group_is_its = leader.pid > 1 && (!head || head->stamp == leader); // a number is not given away while its group has members
    auto* folder = ::opendir("/proc");
    if (!folder) return found;
    while (const auto* entry = ::readdir(folder)) {
        std::int32_t pid = 0;
        auto* end = entry->d_name + std::strlen(entry->d_name);
        auto [stop, problem] = std::from_chars(entry->d_name, end, pid);
        if (problem != std::errc() || stop != end || pid <= 1 || pid == ::getpid()) continue;
        auto told = look_up(pid);
        if (!told || told->ended) continue;
        bool in_group = group_is_its && told->group == leader.pid && told->stamp.start_ticks >= leader.start_ticks;
        if (in_group || carries_mark(pid, mark)) found.push_back(*told);
    }
    ::closedir(folder);
    std::ranges::sort(found, {}, [](const process_entry& one) { return std::pair(one.stamp.start_ticks, one.stamp.pid); });
    return found;
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
    process_end end;
    int status = 0;
    if (pid <= 1 || ::waitpid(pid, &status, wait ? 0 : WNOHANG) != pid) return end;
    end.known = true;
    end.by_signal = WIFSIGNALED(status);
    end.number = end.by_signal ? WTERMSIG(status) : WEXITSTATUS(status);
    return end;
}

} // namespace ise::instantiation
