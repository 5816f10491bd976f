#include <support/terminal_program.hpp>
#include <test_folders.hpp>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace ise_test {
namespace {

constexpr int patience_ms = 60'000;

void set_size(int terminal, std::size_t width, std::size_t height) {
    winsize size{};
    size.ws_col = static_cast<unsigned short>(width);
    size.ws_row = static_cast<unsigned short>(height);
    ::ioctl(terminal, TIOCSWINSZ, &size);
}

std::vector<char*> pointers_to(std::vector<std::string>& texts) {
    std::vector<char*> all;
    for (auto& one : texts) all.push_back(one.data());
    all.push_back(nullptr);
    return all;
}

// The numbers of "1;24"; `otherwise` where there is none.
std::size_t number_in(const std::string& parameters, std::size_t which, std::size_t otherwise) {
    std::size_t at = 0;
    for (; which > 0; --which) {
        at = parameters.find(';', at);
        if (at == parameters.npos) return otherwise;
        ++at;
    }
    std::size_t value = 0, digits = 0;
    for (; at < parameters.size() && parameters[at] >= '0' && parameters[at] <= '9'; ++at, ++digits)
        value = value * 10 + static_cast<std::size_t>(parameters[at] - '0');
    return digits == 0 ? otherwise : value;
}

} // namespace

terminal_program::terminal_program(std::vector<std::string> arguments, std::size_t width, std::size_t height,
                                   start_options options)
    : width_(width), height_(height), bottom_(height - 1), cells_(height, std::vector<std::string>(width, " ")) {
    if (arguments.at(0).find('/') == std::string::npos)
        arguments[0] = std::string(ISE_BINARY_DIR "/bin/") + arguments[0];
    master_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    char name[128];
    if (master_ < 0 || ::grantpt(master_) != 0 || ::unlockpt(master_) != 0 ||
        ::ptsname_r(master_, name, sizeof name) != 0)
        throw std::system_error(errno, std::generic_category(), "no pseudo-terminal");
    slave_ = ::open(name, O_RDWR | O_NOCTTY | O_CLOEXEC); // kept, so that its modes can be read at the end
    set_size(slave_, width, height);
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, name, O_RDWR, 0); // its controlling terminal
    ::posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDERR_FILENO);
    posix_spawnattr_t attributes;
    ::posix_spawnattr_init(&attributes);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID);
    auto has_kind = [](const auto& one) { return one.first == "TERM"; };
    if (std::ranges::none_of(options.variables, has_kind)) options.variables.emplace_back("TERM", "xterm-256color");
    auto variables = variables_with(options);
    auto argument_list = pointers_to(arguments), variable_list = pointers_to(variables);
    int problem =
        ::posix_spawn(&pid_, argument_list[0], &actions, &attributes, argument_list.data(), variable_list.data());
    ::posix_spawn_file_actions_destroy(&actions);
    ::posix_spawnattr_destroy(&attributes);
    if (problem == 0) return;
    pid_ = -1;
    ::close(slave_);
    ::close(master_);
    throw std::system_error(problem, std::generic_category(), "cannot start " + arguments[0]);
}

terminal_program::~terminal_program() {
    if (slave_ >= 0) ::close(slave_);
    if (master_ >= 0) ::close(master_);
    if (pid_ <= 1) return; // -1 would be every process
    ::kill(pid_, SIGKILL);
    int status = 0;
    ::waitpid(pid_, &status, 0);
}

// False once it has ended, and everything that it wrote was read.
bool terminal_program::pump() {
    constexpr int look_ms = 50; // the terminal does not end with the program, as this test holds it, too
    for (int waited = 0; waited < patience_ms; waited += look_ms) {
        pollfd from{master_, POLLIN, 0};
        if (::poll(&from, 1, look_ms) > 0) {
            char piece[4096];
            auto got = ::read(master_, piece, sizeof piece);
            if (got <= 0) return false;
            draw(std::string(piece, static_cast<std::size_t>(got)));
            return true;
        }
        siginfo_t ended{};
        if (pid_ > 1 && ::waitid(P_PID, static_cast<id_t>(pid_), &ended, WEXITED | WNOHANG | WNOWAIT) == 0 &&
            ended.si_pid == pid_) {
            from.revents = 0;
            if (::poll(&from, 1, 0) <= 0) return false;
        }
    }
    return false;
}

bool terminal_program::wait_until(const std::function<bool()>& seen) {
    auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(patience_ms);
    while (!seen()) {
        bool goes_on = pump() && std::chrono::steady_clock::now() < until;
        if (!goes_on) return seen();
    }
    return true;
}

bool terminal_program::wait_for(const std::string& text) {
    return wait_until([&] { return shows(text); });
}

std::vector<std::string> terminal_program::lines() const {
    std::vector<std::string> all;
    for (const auto& row : cells_) {
        std::string line;
        for (const auto& cell : row) line += cell;
        line.erase(line.find_last_not_of(' ') + 1);
        all.push_back(std::move(line));
    }
    return all;
}

bool terminal_program::shows(const std::string& text) const {
    return std::ranges::any_of(lines(), [&](const std::string& line) { return line.find(text) != line.npos; });
}

void terminal_program::press(const std::string& keys) {
    if (::write(master_, keys.data(), keys.size()) != static_cast<ssize_t>(keys.size()))
        throw std::system_error(errno, std::generic_category(), "keys");
}

void terminal_program::resize(std::size_t width, std::size_t height) {
    width_ = width;
    height_ = height;
    top_ = 0;
    bottom_ = height - 1;
    cells_.resize(height);
    for (auto& row : cells_) row.resize(width, " ");
    row_ = std::min(row_, height - 1);
    column_ = std::min(column_, width - 1);
    set_size(slave_, width, height);
}

bool terminal_program::as_a_shell_wants_it() const {
    termios now{};
    return ::tcgetattr(slave_, &now) == 0 && (now.c_lflag & ICANON) && (now.c_lflag & ECHO) && (now.c_lflag & ISIG) &&
           (now.c_iflag & IXON) && now.c_cc[VSUSP] == 26;
}

void terminal_program::signal(int number) {
    if (pid_ > 1) ::kill(pid_, number);
}

void terminal_program::close_window() {
    ::close(std::exchange(slave_, -1));
    ::close(std::exchange(master_, -1));
}

int terminal_program::wait() {
    while (master_ >= 0 && pump()) {}
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {}
    pid_ = -1;
    return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

// --- the screen -----------------------------------------------------------------------------------------------------

void terminal_program::draw(const std::string& bytes) {
    raw_ += bytes;
    rest_ += bytes;
    std::size_t at = 0;
    auto size = rest_.size();
    while (at < size) {
        auto byte = static_cast<unsigned char>(rest_[at]);
        if (byte == 0x1B) {
            if (at + 1 >= size) break;
            char kind = rest_[at + 1];
            if (kind == '[') {
                auto end = at + 2;
                while (end < size && (rest_[end] < '@' || rest_[end] > '~')) ++end;
                if (end >= size) break;
                obey(rest_[end], rest_.substr(at + 2, end - at - 2));
                at = end + 1;
            } else if (kind == '(' || kind == ')') {
                if (at + 2 >= size) break;
                at += 3;
            } else {
                if (kind == 'M') row_ == top_ ? scroll(-1) : static_cast<void>(row_ -= row_ > 0);
                at += 2;
            }
            continue;
        }
        std::size_t length = byte < 0x80 ? 1 : byte < 0xE0 ? 2 : byte < 0xF0 ? 3 : 4;
        if (at + length > size) break;
        auto letter = rest_.substr(at, length);
        at += length;
        if (letter == "\r") column_ = 0, wrap_next_ = false;
        else if (letter == "\n") new_line();
        else if (letter == "\b") column_ -= column_ > 0, wrap_next_ = false;
        else if (letter == "\t") column_ = std::min((column_ / 8 + 1) * 8, width_ - 1);
        else if (byte >= ' ') put(letter);
    }
    rest_.erase(0, at);
}

void terminal_program::put(const std::string& letter) {
    if (wrap_next_) {
        ++wrapped_;
        column_ = 0;
        new_line();
    }
    cells_[row_][column_] = last_letter_ = letter;
    wrap_next_ = column_ + 1 == width_;
    if (!wrap_next_) ++column_;
}

void terminal_program::new_line() {
    wrap_next_ = false;
    if (row_ == bottom_) scroll(1);
    else if (row_ + 1 < height_) ++row_;
}

void terminal_program::scroll(std::ptrdiff_t by) {
    auto from = cells_.begin() + static_cast<std::ptrdiff_t>(top_),
         to = cells_.begin() + static_cast<std::ptrdiff_t>(bottom_) + 1;
    auto size = to - from;
    auto empty = [&](auto begin, auto end) { std::fill(begin, end, std::vector<std::string>(width_, " ")); };
    if (by >= size || -by >= size) return empty(from, to);
    if (by > 0) {
        std::rotate(from, from + by, to);
        empty(to - by, to);
    } else if (by < 0) {
        std::rotate(from, to + by, to);
        empty(from, from - by);
    }
}

void terminal_program::erase(std::size_t row, std::size_t from, std::size_t to) {
    for (auto at = from; at < std::min(to, width_); ++at) cells_[row][at] = " ";
}

void terminal_program::obey(char last, const std::string& parameters) {
    auto first = [&](std::size_t otherwise) { return number_in(parameters, 0, otherwise); };
    auto count = std::max<std::size_t>(first(1), 1);
    auto& line = cells_[row_];
    if (last != 'm') wrap_next_ = false;
    switch (last) {
        case 'A': row_ -= std::min(row_, count); break;
        case 'B': row_ = std::min(row_ + count, height_ - 1); break;
        case 'C': column_ = std::min(column_ + count, width_ - 1); break;
        case 'D': column_ -= std::min(column_, count); break;
        case 'G': column_ = std::min(count, width_) - 1; break;
        case 'd': row_ = std::min(count, height_) - 1; break;
        case 'H':
        case 'f':
            row_ = std::min(count, height_) - 1;
            column_ = std::min(std::max<std::size_t>(number_in(parameters, 1, 1), 1), width_) - 1;
            break;
        case 'J':
            if (first(0) == 0) {
                erase(row_, column_, width_);
                for (auto at = row_ + 1; at < height_; ++at) erase(at, 0, width_);
            } else {
                for (std::size_t at = 0; at < (first(0) == 1 ? row_ : height_); ++at) erase(at, 0, width_);
                if (first(0) == 1) erase(row_, 0, column_ + 1);
            }
            break;
        case 'K': erase(row_, first(0) == 0 ? column_ : 0, first(0) == 1 ? column_ + 1 : width_); break;
        case 'X': erase(row_, column_, column_ + count); break;
        case '@':
            line.insert(line.begin() + static_cast<std::ptrdiff_t>(column_), count, " ");
            line.resize(width_);
            break;
        case 'P':
            line.erase(line.begin() + static_cast<std::ptrdiff_t>(column_),
                       line.begin() + static_cast<std::ptrdiff_t>(std::min(column_ + count, width_)));
            line.resize(width_, " ");
            break;
        case 'L':
        case 'M': {
            auto before = std::exchange(top_, row_);
            scroll(static_cast<std::ptrdiff_t>(count) * (last == 'L' ? -1 : 1));
            top_ = before;
            break;
        }
        case 'S': scroll(static_cast<std::ptrdiff_t>(count)); break;
        case 'T': scroll(-static_cast<std::ptrdiff_t>(count)); break;
        case 'b':
            for (; count > 0; --count) put(std::string(last_letter_));
            break;
        case 'r':
            top_ = count - 1;
            bottom_ = std::min(number_in(parameters, 1, height_), height_) - 1;
            row_ = column_ = 0;
            break;
        case 'h':
        case 'l':
            if (parameters.find("?1049") != std::string::npos) alternate_ = last == 'h';
            if (parameters.find("?25") != std::string::npos || parameters.find(";25") != std::string::npos)
                cursor_visible_ = last == 'h';
            break;
        default: break; // colours, keypads and titles
    }
}

} // namespace ise_test
