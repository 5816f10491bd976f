// environment-boundary: a process of its own, between an instantiation server and what it started
#include <ise/instantiation/keeper.hpp>

#include <ise/instantiation/bounded_log.hpp>
#include <ise/instantiation/cgroup.hpp>
#include <ise/instantiation/kept_status.hpp>
#include <ise/instantiation/own_user.hpp>
#include <ise/instantiation/process_table.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <set>
#include <sstream>

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ; // NOLINT: POSIX declares it nowhere

namespace ise::instantiation {
namespace {

using keeper_clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

const std::string cgroup_word = "cgroup:", user_word = "user:";
constexpr int fixed_keeper_words = 7;    // behind keeper_word, before the program
constexpr rlim_t spare_processes = 4096; // of the same user, whatever he runs beside

std::uint64_t milliseconds_since_boot() {
    timespec now{};
    ::clock_gettime(CLOCK_BOOTTIME, &now);
    return static_cast<std::uint64_t>(now.tv_sec) * 1000 + static_cast<std::uint64_t>(now.tv_nsec) / 1'000'000;
}

std::string ended_text(const process_end& how) {
    if (!how.reason.empty()) return "ended: " + how.reason;
    return how.by_signal ? "ended by " + how.text() : "ended with " + how.text();
}

// Shared memory counts for each that maps it: only where the sum is too high it is looked at closely.
std::uint64_t memory_of(const std::vector<process_entry>& all, std::uint64_t limit) {
    std::uint64_t sum = 0;
    for (const auto& one : all) sum += one.resident_bytes;
    if (sum <= limit) return sum;
    std::uint64_t exact = 0;
    for (const auto& one : all) {
        auto text = content_of_file(fmt::format("/proc/{}/smaps_rollup", one.stamp.pid), 8192);
        auto at = text.find("\nPss:");
        exact +=
            at == std::string::npos ? one.resident_bytes : std::strtoull(text.c_str() + at + 5, nullptr, 10) * 1024;
    }
    return exact;
}

class keeper {
public:
    explicit keeper(launch_order what, const std::string& cgroup_prefix)
        : order_(std::move(what)), cgroup_(cgroup_prefix + order_.mark), use_cgroup_(!cgroup_prefix.empty()),
          log_(order_.output_file, order_.max_output_bytes) {}

    /// Starts the program: why it cannot; empty: it runs.
    std::string start() {
        become_a_keeper();
        if (!order_.user.empty()) {
            auto found = find_user(order_.user);
            if (!found) return fmt::format("cannot start {}: {}", order_.program, found.error().message());
            user_ = std::move(*found);
        }
        if (use_cgroup_ && cgroup_.open(order_.limits)) cgroup_.kill(); // of a life before, whose keeper was killed
        if (order_.limits.cpus != 0 && !cgroup_.keeps_cpus())
            return "the limit of processors cannot be kept here: that takes a control group (version 2) with the "
                   "controller cpu that is delegated to the instantiation server";
        auto again = log_.begin_life(order_.mark);
        auto why = run_program();
        if (!why.empty()) {
            cgroup_.close();
            return why;
        }
        if (again) log_.mark_line(*again);
        log_.set_process(leader_);
        return {};
    }
    const process_stamp& leader() const { return leader_; }

    void keep() {
        bool watches = !cgroup_.keeps_pids() || (order_.limits.memory != 0 && !cgroup_.keeps_memory());
        auto pause = slow_look;
        auto due = keeper_clock::now();
        while (!ended_) {
            int timeout = -1;
            if (watches)
                timeout = static_cast<int>(std::max<long long>(
                    0, std::chrono::ceil<std::chrono::milliseconds>(due - keeper_clock::now()).count()));
            wait_for_news(timeout);
            reap_all();
            if (ended_ || !watches || keeper_clock::now() < due) continue;
            pause = check_limits() ? quick_look : slow_look;
            due = keeper_clock::now() + pause;
        }
        end_tree();
        while (read_output()) {}
        if (how_.reason.empty() && cgroup_.ran_out_of_memory())
            how_.reason =
                fmt::format("killed by the kernel: it used more than its limit of memory ({})", as_text(order_.limits));
        cgroup_.close();
        log_.mark_line(ended_text(how_));
        log_.end_life(how_, milliseconds_since_boot());
    }

private:
    static constexpr keeper_clock::duration slow_look = 100ms, quick_look = 20ms;

    void become_a_keeper() {
        ::prctl(PR_SET_NAME, "ise_keeper", 0, 0, 0);
        ::prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0);
        // What is meant for the program ends that, and then this.
        for (int one : {SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGPIPE, SIGTSTP}) ::signal(one, SIG_IGN);
        sigset_t children;
        ::sigemptyset(&children);
        ::sigaddset(&children, SIGCHLD);
        ::sigprocmask(SIG_BLOCK, &children, nullptr);
        signals_ = file_handle(::signalfd(-1, &children, SFD_CLOEXEC | SFD_NONBLOCK));
    }

    std::string run_program() {
        int output[2] = {-1, -1}, refusal[2] = {-1, -1};
        if (::pipe2(output, O_CLOEXEC) != 0 || ::pipe2(refusal, O_CLOEXEC) != 0)
            return fmt::format("cannot make a pipe: {}", std::strerror(errno));
        output_ = file_handle(output[0]);
        ::fcntl(output_.get(), F_SETFL, O_NONBLOCK);
        file_handle writing(output[1]), why(refusal[0]), refuse(refusal[1]);
        auto me = ::getpid();
        auto pid = ::fork();
        if (pid < 0) return fmt::format("cannot start {}: {}", order_.program, std::strerror(errno));
        if (pid == 0) {
            become_the_program(me, writing.get());
            const std::array<int, 2> problem{errno, failed_step_};
            [[maybe_unused]] auto result = ::write(refuse.get(), problem.data(), sizeof problem);
            ::_exit(127);
        }
        writing = file_handle();
        refuse = file_handle();
        std::array<int, 2> problem{};
        ssize_t got = 0;
        do got = ::read(why.get(), problem.data(), sizeof problem);
        while (got < 0 && errno == EINTR);
        if (got > 0) {
            ::waitpid(pid, nullptr, 0);
            return fmt::format(
                "cannot start {}{}: {}{}", order_.program, user_ ? fmt::format(" as user '{}'", user_->name) : "",
                problem[1] == 0 ? "" : fmt::format("{}: ", name_of_step(problem[1])), std::strerror(problem[0]));
        }
        auto result = look_up(pid); // not reaped: the number is its own
        if (result) leader_ = result->stamp;
        return result ? std::string() : fmt::format("cannot watch process {} of {}", pid, order_.program);
    }

    // Only returns if it cannot.
    void become_the_program(pid_t keeper_pid, int output) {
        ::setsid();
        ::prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0); // nothing runs without its keeper
        if (::getppid() != keeper_pid) ::_exit(127);
        if (cgroup_.is_open() && !cgroup_.enter()) return;
        if (!cgroup_.keeps_pids()) bound_processes_of_user(user_ ? user_->id : ::geteuid());
        if (user_) {
            failed_step_ = become(*user_);
            if (failed_step_ != 0) return;
            ::prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0); // it went with the user
            if (::getppid() != keeper_pid) ::_exit(127);
        }
        for (int one : {SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGPIPE, SIGTSTP}) ::signal(one, SIG_DFL);
        sigset_t none;
        ::sigemptyset(&none);
        ::sigprocmask(SIG_SETMASK, &none, nullptr);
        ::dup2(output, STDOUT_FILENO);
        ::dup2(output, STDERR_FILENO);
        std::vector<std::string> words{order_.program};
        words.insert(words.end(), order_.words.begin(), order_.words.end());
        std::vector<std::string> variables{fmt::format("{}={}", mark_variable, order_.mark)};
        auto mine = fmt::format("{}=", keeper_variable);
        for (char** one = environ; *one; ++one)
            if (!std::string_view(*one).starts_with(mine) && !(user_ && is_of_user(*one))) variables.emplace_back(*one);
        if (user_)
            for (auto own : {fmt::format("HOME={}", user_->home), fmt::format("USER={}", user_->name),
                             fmt::format("LOGNAME={}", user_->name)})
                variables.push_back(std::move(own));
        auto pointers = [](std::vector<std::string>& of) {
            std::vector<char*> all;
            for (auto& one : of) all.push_back(one.data());
            all.push_back(nullptr);
            return all;
        };
        ::execve(order_.program.c_str(), pointers(words).data(), pointers(variables).data());
    }

    // Variables that would be those of the server's user.
    static bool is_of_user(std::string_view variable) {
        return std::ranges::any_of(
            std::array<std::string_view, 5>{"HOME=", "USER=", "LOGNAME=", "XDG_RUNTIME_DIR=", "TMPDIR="},
            [&](std::string_view name) { return variable.starts_with(name); });
    }

    // A ceiling that holds while the tree is being stopped; root has none.
    static void bound_processes_of_user(uid_t user) {
        rlimit now{};
        if (user == 0 || ::getrlimit(RLIMIT_NPROC, &now) != 0) return;
        rlim_t wanted = threads_of_user(user) + spare_processes;
        if (now.rlim_max != RLIM_INFINITY) wanted = std::min(wanted, now.rlim_max);
        now.rlim_cur = now.rlim_max = wanted;
        ::setrlimit(RLIMIT_NPROC, &now);
    }

    void wait_for_news(int timeout) {
        std::array<pollfd, 2> from{};
        from[0] = {signals_.get(), POLLIN, 0};
        from[1] = {output_.get(), POLLIN, 0};
        ::poll(from.data(), output_ ? 2 : 1, timeout);
        signalfd_siginfo ignored{};
        while (::read(signals_.get(), &ignored, sizeof ignored) > 0) {}
        if (output_ && from[1].revents != 0) read_output();
    }

    // False: there is nothing more at the moment.
    bool read_output() {
        if (!output_) return false;
        std::array<char, 65536> piece; // what a pipe holds
        auto got = ::read(output_.get(), piece.data(), piece.size());
        if (got < 0 && errno == EINTR) return true;
        if (got == 0 || (got < 0 && errno != EAGAIN)) output_ = file_handle();
        if (got > 0) log_.append({piece.data(), static_cast<std::size_t>(got)});
        return got > 0;
    }

    // The program, and whatever lost its parent below it. False: nothing is left.
    bool reap_all() {
        for (;;) {
            int status = 0;
            auto pid = ::waitpid(-1, &status, WNOHANG);
            if (pid == 0) return true;
            if (pid < 0) return errno == EINTR;
            if (pid != leader_.pid || ended_) continue;
            ended_ = true;
            auto reason = std::move(how_.reason);
            how_ = end_of_status(status);
            how_.reason = std::move(reason);
        }
    }

    // Gives whether it has started other processes.
    bool check_limits() {
        const auto& limits = order_.limits;
        std::vector<process_entry> all;
        std::uint64_t tasks = 0;
        bool counts = !cgroup_.keeps_pids();
        visit_descendants(::getpid(), [&](const process_entry& one) { // beyond the limit there is no time for more
            all.push_back(one);
            tasks += std::max<std::uint64_t>(one.threads, 1);
            return !counts || tasks <= limits.pids;
        });
        if (counts && tasks > limits.pids)
            how_.reason =
                fmt::format("killed: it had more processes and threads than its limit of {} (pids)", limits.pids);
        else if (limits.memory != 0 && !cgroup_.keeps_memory() && memory_of(all, limits.memory) > limits.memory)
            how_.reason = fmt::format("killed: it used more than its limit of memory ({})", as_text(limits));
        if (!how_.reason.empty()) end_tree();
        return all.size() > 1;
    }

    /// Kills everything below this process. What starts others faster than one looks is stopped first, until there is
    /// nothing new.
    void end_tree() {
        sched_param first{};
        first.sched_priority = 1;
        ::sched_setscheduler(0, SCHED_RR, &first); // before hundreds that all want to run; only root may
        constexpr int max_rounds = 100;
        while (reap_all()) {
            cgroup_.kill();
            std::set<std::int32_t> found, groups;
            bool more = true;
            for (int round = 0; more && round < max_rounds; ++round) {
                std::set<std::int32_t> stopped;
                more = false;
                visit_descendants(::getpid(), [&](const process_entry& one) {
                    if (one.ended || !found.insert(one.stamp.pid).second) return true;
                    more = true;
                    groups.insert(one.group);
                    // At once: thousands may run.
                    if (stopped.insert(one.group).second) signal_group(one.group, SIGSTOP);
                    return true;
                });
            }
            for (auto one : groups) signal_group(one, SIGKILL);
            while (read_output()) {}
            if (!reap_all()) return;
            wait_for_news(5); // the kernel takes a moment; one that waits for a device longer
        }
    }

    // The program began a session: the groups of all below it have members from below it only.
    static void signal_group(std::int32_t group, int number) {
        if (group > 1 && group != ::getpgrp()) ::kill(-group, number); // NOLINT(environment): as above
    }

    launch_order order_;
    std::optional<os_user> user_; ///< that the program becomes
    int failed_step_ = 0;         ///< of that, in the child
    cgroup cgroup_;
    bool use_cgroup_;
    bounded_log log_;
    file_handle signals_, output_;
    process_stamp leader_;
    bool ended_ = false;
    process_end how_;
};

void tell_starter(const std::string& text) {
    auto line = text + "\n";
    [[maybe_unused]] auto result = ::write(STDOUT_FILENO, line.data(), line.size());
    file_handle nowhere(::open("/dev/null", O_RDWR | O_CLOEXEC));
    ::dup2(nowhere.get(), STDOUT_FILENO);
    ::dup2(nowhere.get(), STDERR_FILENO);
}

template <class Number>
Number word_as_number(const char* text) {
    Number made{};
    std::from_chars(text, text + std::strlen(text), made);
    return made;
}

} // namespace

std::vector<std::string> keeper_words(const launch_order& what, const std::string& cgroup_prefix) {
    const auto& limits = what.limits;
    std::vector<std::string> words{keeper_word,
                                   what.output_file,
                                   fmt::format("{}", what.max_output_bytes),
                                   fmt::format("{}", limits.pids),
                                   fmt::format("{}", limits.memory),
                                   fmt::format("{}", limits.cpus),
                                   cgroup_word + cgroup_prefix, // Boost.Process takes no empty word
                                   user_word + what.user,
                                   what.program};
    words.insert(words.end(), what.words.begin(), what.words.end());
    return words;
}

std::string line_of_keeper(int from, std::chrono::milliseconds limit) {
    std::string text;
    std::array<char, 512> piece;
    auto until = keeper_clock::now() + limit;
    while (text.find('\n') == std::string::npos) {
        auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - keeper_clock::now()).count();
        if (left <= 0) break;
        pollfd more{from, POLLIN, 0};
        auto ready = ::poll(&more, 1, static_cast<int>(left));
        if (ready < 0 && errno == EINTR) continue;
        if (ready <= 0) break;
        auto got = ::read(from, piece.data(), piece.size());
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) break;
        text.append(piece.data(), static_cast<std::size_t>(got));
    }
    return text.substr(0, text.find('\n'));
}

std::optional<int> keep_if_asked(int count, const char* const* words) {
    if (count < 2 || std::strcmp(words[1], keeper_word) != 0) return {};
    const char* mark = std::getenv(keeper_variable);
    if (count < 2 + fixed_keeper_words + 1 || !mark) {
        tell_starter("an instantiation server calls itself so: --help tells what people do");
        return 2;
    }
    launch_order order;
    order.output_file = words[2];
    order.max_output_bytes = word_as_number<std::uint64_t>(words[3]);
    order.limits.pids = word_as_number<std::uint32_t>(words[4]);
    order.limits.memory = word_as_number<std::uint64_t>(words[5]);
    order.limits.cpus = word_as_number<double>(words[6]);
    order.user = words[8] + user_word.size();
    order.program = words[9];
    order.words.assign(words + 10, words + count);
    order.mark = mark;
    keeper made(std::move(order), words[7] + cgroup_word.size());
    auto why = made.start();
    if (!why.empty()) {
        tell_starter(why);
        return 1;
    }
    tell_starter(fmt::format("started {} {}", made.leader().pid, made.leader().start_ticks));
    made.keep();
    return 0;
}

} // namespace ise::instantiation
