// environment-boundary: Boost.Process starts programs by itself; no header of Asio may be seen here
#include <ise/instantiation/spawn.hpp>

#include <boost/process/args.hpp>
#include <boost/process/child.hpp>
#include <boost/process/env.hpp>
#include <boost/process/environment.hpp>
#include <boost/process/error.hpp>
#include <boost/process/exe.hpp>
#include <boost/process/extend.hpp>
#include <boost/process/group.hpp>
#include <boost/process/io.hpp>

#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <fcntl.h>
#include <memory>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

namespace ise::instantiation {
namespace {

namespace bp = boost::process;

// A program finds the signals as it expects them, and of our descriptors only its three streams. (`limit_handles` of
// Boost 1.74 also closes the pipe by which the child tells that the program cannot be executed.)
struct clean_start : bp::extend::handler {
    template <class Executor>
    void on_exec_setup(Executor&) const {
        sigset_t none;
        ::sigemptyset(&none);
        ::sigprocmask(SIG_SETMASK, &none, nullptr); // threads of ours may block some
        for (int number : {SIGPIPE, SIGINT, SIGTERM, SIGHUP, SIGCHLD}) ::signal(number, SIG_DFL);
        constexpr unsigned first = STDERR_FILENO + 1, close_on_exec = 4; // CLOSE_RANGE_CLOEXEC
        if (::syscall(SYS_close_range, first, ~0U, close_on_exec) == 0) return;
        auto most = ::sysconf(_SC_OPEN_MAX); // a kernel before 5.11
        for (int number = STDERR_FILENO + 1; number < most; ++number) ::fcntl(number, F_SETFD, FD_CLOEXEC);
    }
};

// A child that could not become the program: Boost forgets it.
struct no_zombie : bp::extend::handler {
    template <class Executor>
    void on_error(Executor& executor, const std::error_code&) const {
        if (executor.pid <= 1) return;
        ::kill(executor.pid, SIGKILL);
        ::waitpid(executor.pid, nullptr, 0);
    }
};

struct closing {
    void operator()(std::FILE* file) const { std::fclose(file); }
};

} // namespace

result<int> spawn(const launch_order& what, int output) {
    int opened = ::fcntl(output, F_DUPFD_CLOEXEC, 3);
    if (opened < 0)
        return io_failure(fmt::format("cannot start {}", what.program), std::error_code(errno, std::system_category()));
    std::unique_ptr<std::FILE, closing> sink(::fdopen(opened, "a"));
    bp::environment variables;
    for (const auto& [name, value] : what.variables) variables[name] = value;
    std::error_code problem;
    try {
        bp::group alone;
        bp::child made(bp::exe = what.program, bp::args = what.words, variables, alone, clean_start{}, no_zombie{},
                       bp::std_in<bp::null, (bp::std_out & bp::std_err)> sink.get(), problem);
        alone.detach();
        made.detach();
        auto pid = static_cast<int>(made.id());
        if (problem || pid <= 1) return io_failure(fmt::format("cannot start {}", what.program), problem);
        return pid;
    } catch (const std::exception& thrown) {
        return failure(errc::io_failed, fmt::format("cannot start {}: {}", what.program, thrown.what()));
    }
}

} // namespace ise::instantiation
