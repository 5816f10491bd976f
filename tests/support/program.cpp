#include <support/program.hpp>
#include <test_folders.hpp>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string_view>
#include <system_error>

extern char** environ; // NOLINT: POSIX says so

namespace ise_test {
namespace {

constexpr int most_silence_ms = 400'000; // less than the time limit of a test, so that its output is shown

struct pipe_ends {
    int read = -1, write = -1;
};

pipe_ends make_pipe() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe2");
    return {ends[0], ends[1]};
}

void shut(int& descriptor) {
    if (descriptor >= 0) ::close(descriptor);
    descriptor = -1;
}

// An input of any length: a file is never full, as a pipe is that nobody reads.
int input_file(const std::string& text) {
    char name[] = "/tmp/ise-test-input-XXXXXX";
    int file = ::mkostemp(name, O_CLOEXEC);
    if (file < 0) throw std::system_error(errno, std::generic_category(), "mkostemp");
    ::unlink(name);
    std::string_view left = text;
    while (!left.empty()) {
        auto moved = ::write(file, left.data(), left.size());
        if (moved < 0) throw std::system_error(errno, std::generic_category(), "write");
        left.remove_prefix(static_cast<std::size_t>(moved));
    }
    ::lseek(file, 0, SEEK_SET);
    return file;
}

} // namespace

std::vector<std::string> variables_with(const start_options& options) {
    auto given = options.variables;
    given.emplace_back("XDG_STATE_HOME",
                       ISE_BINARY_DIR "/tests/state"); // nothing is left in the home of whoever runs the tests
    std::vector<std::string> variables;
    for (const auto& [name, value] : given) variables.push_back(name + "=" + value);
    for (char** one = environ; *one; ++one) {
        std::string_view text = *one;
        bool replaced = false;
        for (const auto& [name, value] : given) replaced = replaced || text.starts_with(name + "=");
        if (!replaced) variables.emplace_back(text);
    }
    return variables;
}

program::program(std::vector<std::string> arguments, start_options options) {
    if (arguments.at(0).find('/') == std::string::npos)
        arguments[0] = std::string(ISE_BINARY_DIR "/bin/") + arguments[0];
    auto out = make_pipe(), err = make_pipe();
    int in = input_file(options.input);
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, in, STDIN_FILENO);
    if (!options.output_file.empty()) {
        ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, options.output_file.c_str(), O_WRONLY, 0);
    } else if (options.closed_output) {
        ::posix_spawn_file_actions_addclose(&actions, STDOUT_FILENO);
    } else {
        ::posix_spawn_file_actions_adddup2(&actions, out.write, STDOUT_FILENO);
    }
    ::posix_spawn_file_actions_adddup2(&actions, err.write, STDERR_FILENO);

    auto variables = variables_with(options);
    std::vector<char*> argument_list, variable_list;
    for (auto& one : arguments) argument_list.push_back(one.data());
    for (auto& one : variables) variable_list.push_back(one.data());
    argument_list.push_back(nullptr);
    variable_list.push_back(nullptr);

    int problem = ::posix_spawn(&pid_, argument_list[0], &actions, nullptr, argument_list.data(), variable_list.data());
    ::posix_spawn_file_actions_destroy(&actions);
    shut(in);
    shut(out.write);
    shut(err.write);
    out_ = out.read;
    err_ = err.read;
    if (problem != 0) {
        pid_ = -1;
        shut(out_);
        shut(err_);
        throw std::system_error(problem, std::generic_category(), "cannot start " + arguments[0]);
    }
}

program::~program() {
    shut(out_);
    shut(err_);
    if (pid_ <= 1) return; // -1 would be every process
    ::kill(pid_, SIGKILL);
    int status = 0;
    ::waitpid(pid_, &status, 0);
}

bool program::pump() {
    pollfd both[2] = {{out_, POLLIN, 0}, {err_, POLLIN, 0}}; // negative ones are passed over
    if (out_ < 0 && err_ < 0) return false;
    const auto ready = ::poll(both, 2, most_silence_ms);
    if (ready < 0) return errno == EINTR;
    if (ready == 0) throw std::runtime_error("a program hangs, after: " + so_far_.out + so_far_.err);
    auto take = [](const pollfd& from, int& descriptor, std::string& into) {
        if (from.revents == 0) return;
        char piece[4096];
        auto got = ::read(descriptor, piece, sizeof piece);
        if (got > 0) into.append(piece, static_cast<std::size_t>(got));
        else if (got == 0 || errno != EINTR) shut(descriptor);
    };
    take(both[0], out_, so_far_.out);
    take(both[1], err_, so_far_.err);
    return true;
}

std::string program::next_line(std::string& of, const int& from) {
    std::size_t end = 0;
    while ((end = of.find('\n')) == std::string::npos)
        if (from < 0 || !pump()) return std::exchange(of, {});
    auto line = of.substr(0, end);
    of.erase(0, end + 1);
    return line;
}

std::string program::read_line() { return next_line(so_far_.out, out_); }
std::string program::read_error_line() { return next_line(so_far_.err, err_); }

void program::close_output() { shut(out_); }

void program::signal(int number) {
    if (pid_ > 1) ::kill(pid_, number);
}

ran program::wait() {
    while (pump()) {}
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {}
    pid_ = -1;
    so_far_.exit_code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    return std::move(so_far_);
}

ran run_program(std::vector<std::string> arguments, start_options options) {
    return program(std::move(arguments), std::move(options)).wait();
}

} // namespace ise_test
