#include "../terminal.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <clocale>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <cwchar>
#include <langinfo.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>
#include <utility>

#define NCURSES_WIDECHAR 1
#define NCURSES_NOMACROS // erase, move, timeout and others are words of C++ programs
#include <curses.h>

namespace ise::cli {
namespace {

constexpr int escape_delay_ms = 25; // an Esc that no sequence follows
constexpr wint_t ctrl_z = 26, ctrl_l = 12, escape_key = 27, del = 127;

SCREEN* taken = nullptr; // by the only one
bool coloured = false;

// Neither Ctrl-S nor Ctrl-Z may stop the command inside of ncurses: a stopped loop cannot be ended by Ctrl-C.
void keep_keys_to_itself() {
    termios now{};
    if (::tcgetattr(STDIN_FILENO, &now) != 0) return;
    now.c_iflag &= ~static_cast<tcflag_t>(IXON);
    now.c_cc[VSUSP] = _POSIX_VDISABLE;
    ::tcsetattr(STDIN_FILENO, TCSANOW, &now);
    ::def_prog_mode();
}

short pair_of(style how) {
    switch (how) {
        case style::good: return 1;
        case style::warning: return 2;
        case style::bad: return 3;
        case style::accent: return 4;
        default: return 0;
    }
}

// Without colours, bold and reverse still tell what matters.
attr_t attributes_of(style how) {
    switch (how) {
        case style::dim: return A_DIM;
        case style::warning: return coloured ? A_NORMAL : A_BOLD;
        case style::bad: return A_BOLD;
        case style::heading: return A_BOLD;
        case style::accent: return coloured ? A_NORMAL : A_BOLD;
        default: return A_NORMAL;
    }
}

bool takes_output() {
    pollfd out{STDOUT_FILENO, POLLOUT, 0};
    return ::poll(&out, 1, 0) == 1 && (out.revents & POLLOUT) != 0;
}

// Sparklines are UTF-8, as everything that ISE prints: also where the locale was never set.
void use_utf8() {
    std::setlocale(LC_CTYPE, "");
    if (std::strcmp(::nl_langinfo(CODESET), "UTF-8") != 0) std::setlocale(LC_CTYPE, "C.UTF-8");
}

std::string utf8_of(wint_t letter) {
    char bytes[16];
    std::mbstate_t state{};
    auto length = std::wcrtomb(bytes, static_cast<wchar_t>(letter), &state);
    return length == static_cast<std::size_t>(-1) ? std::string() : std::string(bytes, length);
}

std::optional<key_press> key_of(wint_t code) {
    using enum key_press::kind;
    switch (code) {
        case KEY_UP: return key_press{up, {}};
        case KEY_DOWN: return key_press{down, {}};
        case KEY_LEFT: return key_press{left, {}};
        case KEY_RIGHT: return key_press{right, {}};
        case KEY_PPAGE: return key_press{page_up, {}};
        case KEY_NPAGE: return key_press{page_down, {}};
        case KEY_HOME: return key_press{home, {}};
        case KEY_END: return key_press{end, {}};
        case KEY_ENTER: return key_press{enter, {}};
        case KEY_BACKSPACE: return key_press{backspace, {}};
        case KEY_BTAB: return key_press{back_tab, {}};
        case KEY_RESIZE: return key_press{resized, {}};
        default: return std::nullopt;
    }
}

// The shell shows its prompt on a terminal that is as it was; on `fg` the page is drawn anew.
void suspend() {
    ::endwin();
    ::kill(0, SIGTSTP);
    ::clearok(stdscr, TRUE);
    ::refresh();
}

} // namespace

bool terminal::available() {
    return ::isatty(STDOUT_FILENO) == 1 && ::isatty(STDIN_FILENO) == 1 && ::tcgetpgrp(STDIN_FILENO) == ::getpgrp();
}

std::unique_ptr<terminal> terminal::open(bool colours, std::string& why) {
    use_utf8();
    const char* kind = std::getenv("TERM");
    // ncurses would act on it within the signal's handler, on any thread.
    auto before = std::signal(SIGTSTP, SIG_IGN);
    taken = ::newterm(nullptr, stdout, stdin);
    std::signal(SIGTSTP, before);
    if (!taken) {
        why = fmt::format("terminfo does not know the terminal '{}' (TERM): install ncurses-term, or set "
                          "TERM=xterm-256color",
                          kind ? kind : "");
        return nullptr;
    }
    if (!::tigetstr("cup")) {
        why = fmt::format("the terminal '{}' (TERM) cannot place its cursor", kind ? kind : "");
        ::endwin();
        ::delscreen(std::exchange(taken, nullptr));
        return nullptr;
    }
    ::cbreak();
    ::noecho();
    ::nonl();
    keep_keys_to_itself();
    ::keypad(stdscr, TRUE);
    ::nodelay(stdscr, TRUE);
    ::set_escdelay(escape_delay_ms);
    ::curs_set(0);
    coloured = colours && ::has_colors();
    if (coloured) {
        ::start_color();
        ::use_default_colors();
        ::init_pair(pair_of(style::good), COLOR_GREEN, -1);
        ::init_pair(pair_of(style::warning), COLOR_YELLOW, -1);
        ::init_pair(pair_of(style::bad), COLOR_RED, -1);
        ::init_pair(pair_of(style::accent), COLOR_CYAN, -1);
    }
    return std::unique_ptr<terminal>(new terminal());
}

terminal::~terminal() {
    // A terminal that takes nothing more would hold up the end.
    if (takes_output()) ::endwin();
    else ::reset_shell_mode();
    ::delscreen(taken);
    taken = nullptr;
}

std::size_t terminal::width() const { return static_cast<std::size_t>(std::max(::getmaxx(stdscr), 1)); }
std::size_t terminal::height() const { return static_cast<std::size_t>(std::max(::getmaxy(stdscr), 1)); }

bool terminal::show(const styled_page& page) {
    if (!takes_output()) return false;
    ::werase(stdscr);
    auto count = std::min(page.size(), height());
    for (std::size_t at = 0; at < count; ++at) {
        const auto& line = page[at];
        ::wmove(stdscr, static_cast<int>(at), 0);
        for (const auto& part : line.parts) {
            // The bar of the selection has one colour, but for what is wrong.
            bool wrong = part.how == style::warning || part.how == style::bad;
            auto how = line.selected && !wrong ? style::plain : part.how;
            auto looks = attributes_of(how) | (line.selected ? A_REVERSE : A_NORMAL);
            ::wattr_set(stdscr, looks, coloured ? pair_of(how) : short{0}, nullptr);
            ::waddnstr(stdscr, part.text.c_str(), -1);
        }
        ::wattr_set(stdscr, line.selected ? A_REVERSE : A_NORMAL, 0, nullptr);
        if (line.selected)
            for (auto from = ::getcurx(stdscr), y = ::getcury(stdscr);
                 y == static_cast<int>(at) && from + 1 < ::getmaxx(stdscr); ++from)
                ::waddch(stdscr, ' ');
        ::wattr_set(stdscr, A_NORMAL, 0, nullptr);
    }
    ::wrefresh(stdscr);
    return true;
}

std::optional<key_press> terminal::read() {
    using enum key_press::kind;
    wint_t code = 0;
    auto sort = ::wget_wch(stdscr, &code);
    if (sort == ERR) return std::nullopt;
    if (sort == KEY_CODE_YES) return key_of(code);
    switch (code) {
        case L'\r':
        case L'\n': return key_press{enter, {}};
        case L'\t': return key_press{tab, {}};
        case escape_key: return key_press{escape, {}};
        case L'\b':
        case del: return key_press{backspace, {}};
        case ctrl_z: suspend(); return key_press{resized, {}};
        case ctrl_l: ::clearok(stdscr, TRUE); return key_press{resized, {}};
        default: break;
    }
    if (code < L' ') return std::nullopt;
    return key_press{text, utf8_of(code)};
}

bool terminal::gone() const {
    pollfd in{STDIN_FILENO, POLLIN, 0};
    return ::poll(&in, 1, 0) > 0 && (in.revents & (POLLHUP | POLLERR | POLLNVAL)) != 0;
}

} // namespace ise::cli
