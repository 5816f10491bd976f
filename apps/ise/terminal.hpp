#pragma once
#include "styled.hpp"

#include <cstddef>
#include <memory>
#include <optional>
#include <string>

namespace ise::cli {

/// The terminal of standard input and output while a command draws pages on it, by ncurses. It is as it was again once
/// this is destroyed, however the command ends; while the command is suspended (Ctrl-Z), too. One at a time, used from
/// one thread.
class terminal {
public:
    /// Whether standard input and output are a terminal, and the command runs in its foreground.
    static bool available();
    /// Takes the terminal. Nothing: it cannot place a cursor, or terminfo does not know it, and `why` says so.
    static std::unique_ptr<terminal> open(bool colours, std::string& why);
    ~terminal();
    terminal(const terminal&) = delete;
    terminal& operator=(const terminal&) = delete;

    std::size_t width() const;
    std::size_t height() const;
    /// Draws what differs from the page before; what does not fit is cut. False: the terminal takes nothing at the
    /// moment, and the page is to be shown again.
    bool show(const styled_page& page);
    /// The next key that was pressed; nothing: none. Returns at once, except for Ctrl-Z: then once the command runs
    /// again.
    std::optional<key_press> read();
    /// The terminal was closed: nobody will see another page.
    bool gone() const;

private:
    terminal() = default;
};

} // namespace ise::cli
