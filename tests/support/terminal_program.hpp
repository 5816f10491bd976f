#pragma once
#include <support/program.hpp>

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace ise_test {

/// A program on a terminal of its own (a pseudo-terminal), whose screen is read as a person sees it. Understands what
/// ncurses sends to an xterm. Destroying it ends the program.
class terminal_program {
public:
    terminal_program(std::vector<std::string> arguments, std::size_t width, std::size_t height,
                     start_options options = start_options());
    ~terminal_program();
    terminal_program(const terminal_program&) = delete;
    terminal_program& operator=(const terminal_program&) = delete;

    /// Reads until `seen` holds; false: the program has ended before, or a minute has passed.
    bool wait_until(const std::function<bool()>& seen);
    /// The same until a line of the screen contains `text`.
    bool wait_for(const std::string& text);
    /// The lines of the screen, without blanks at their ends.
    std::vector<std::string> lines() const;
    bool shows(const std::string& text) const;
    bool on_alternate_screen() const noexcept { return alternate_; }
    bool cursor_is_visible() const noexcept { return cursor_visible_; }
    /// Characters that were written beyond the last column.
    std::size_t wrapped() const noexcept { return wrapped_; }
    /// Everything that it has written.
    const std::string& raw() const noexcept { return raw_; }

    void press(const std::string& keys);
    void resize(std::size_t width, std::size_t height);
    /// Input comes by lines and is shown, as a shell wants it.
    bool as_a_shell_wants_it() const;
    void signal(int number);
    /// As when the window is closed.
    void close_window();
    /// Reads until it has ended; its exit code, 128 + the signal that ended it.
    int wait();

private:
    bool pump();
    void draw(const std::string& bytes);
    void obey(char last, const std::string& parameters);
    void put(const std::string& letter);
    void new_line();
    void scroll(std::ptrdiff_t by);
    void erase(std::size_t row, std::size_t from, std::size_t to);

    int pid_ = -1, master_ = -1, slave_ = -1;
    std::size_t width_, height_, row_ = 0, column_ = 0, top_ = 0, bottom_;
    bool wrap_next_ = false, alternate_ = false, cursor_visible_ = true;
    std::size_t wrapped_ = 0;
    std::vector<std::vector<std::string>> cells_;
    std::string raw_, rest_, last_letter_ = " ";
};

} // namespace ise_test
