#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>

#include <unistd.h>

/// One line on standard error that tells how far a long work is and how long it will take, where that is a terminal;
/// elsewhere nothing. It is gone when this is destroyed.
class progress_line {
public:
    progress_line() : shown_on_terminal_(::isatty(STDERR_FILENO) == 1) {}
    ~progress_line() { clear(); }
    progress_line(const progress_line&) = delete;
    progress_line& operator=(const progress_line&) = delete;

    /// `part` of the work is done, 0 to 1. Draws at most five times a second: call it often.
    void show(double part, const std::string& text) {
        auto now = clock::now();
        if (!shown_on_terminal_ || (drawn_ && now - last_ < std::chrono::milliseconds(200))) return;
        last_ = now;
        drawn_ = true;
        part = std::clamp(part, 0.0, 1.0);
        auto passed = std::chrono::duration<double>(now - began_).count();
        auto line = fmt::format("{:3.0f} %  {}, {}", part * 100, text, time_text(passed));
        // What was quick at first says little.
        if (part > 0.01 && part < 1 && passed > 1)
            line += fmt::format(", about {} left", time_text(passed / part - passed));
        constexpr std::size_t columns = 79;
        fmt::print(stderr, "\r\x1b[K{}", line.substr(0, columns));
        std::fflush(stderr);
    }
    /// What is printed next stands on an empty line.
    void clear() {
        if (drawn_) fmt::print(stderr, "\r\x1b[K");
        std::fflush(stderr);
        drawn_ = false;
    }

private:
    using clock = std::chrono::steady_clock;
    static std::string time_text(double seconds) {
        auto whole = static_cast<long>(seconds + 0.5);
        if (whole < 60) return fmt::format("{} s", whole);
        if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
        return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
    }

    const bool shown_on_terminal_;
    bool drawn_ = false;
    clock::time_point began_ = clock::now(), last_{};
};
