#include "screen.hpp"

#include "text.hpp"

#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <string_view>

namespace ise::cli {
namespace {

// Briefly: a terminal that does not take it is not worth waiting for.
void put(std::string_view text) {
    pollfd out{STDOUT_FILENO, POLLOUT, 0};
    if (::poll(&out, 1, 100) == 1) [[maybe_unused]]
        auto written = ::write(STDOUT_FILENO, text.data(), text.size());
}

} // namespace

// Keys come at once and are not shown; Ctrl-C stays a signal.
struct screen::keyboard {
    termios before{};
};

screen::screen() : live_(::isatty(STDOUT_FILENO) == 1) {
    if (!live_) return;
    put("\x1b[?1049h\x1b[?25l");
    // In the background the terminal is another's.
    if (::isatty(STDIN_FILENO) != 1 || ::tcgetpgrp(STDIN_FILENO) != ::getpgrp()) return;
    termios now{};
    if (::tcgetattr(STDIN_FILENO, &now) != 0) return;
    keys_ = std::make_unique<keyboard>();
    keys_->before = now;
    now.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    now.c_cc[VMIN] = 0;
    now.c_cc[VTIME] = 0;
    ::tcsetattr(STDIN_FILENO, TCSANOW, &now);
}

screen::~screen() {
    if (keys_) ::tcsetattr(STDIN_FILENO, TCSANOW, &keys_->before);
    if (live_) put("\x1b[?25h\x1b[?1049l");
}

std::size_t screen::height() const {
    winsize size{};
    if (!live_ || ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0) return 0;
    return size.ws_row;
}

std::string screen::page(std::string text, std::size_t width) const {
    if (!live_) return text;
    auto lines = height();
    std::string shown = "\x1b[H";
    std::size_t count = 0;
    for (std::size_t from = 0; from < text.size();) {
        auto to = text.find('\n', from);
        if (to == text.npos) to = text.size();
        if (lines > 1 && ++count >= lines) break; // the last line stays free: an end of line there would scroll
        shown += cut(text.substr(from, to - from), width) + "\x1b[K\n";
        from = to + 1;
    }
    return shown + "\x1b[J";
}

bool screen::quit() const {
    if (!keys_) return false;
    char pressed[64];
    auto count = ::read(STDIN_FILENO, pressed, sizeof pressed);
    return count > 0 &&
           std::string_view(pressed, static_cast<std::size_t>(count)).find_first_of("qQ") != std::string_view::npos;
}

} // namespace ise::cli
