#pragma once
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace ise_test {

/// What a program that ran to its end left.
struct ran {
    int exit_code = -1; ///< 128 + the signal that ended it
    std::string out;
    std::string err;
};

/// How a program is started beside its arguments.
struct start_options {
    std::string input;                                          ///< on its standard input, which is then closed
    std::vector<std::pair<std::string, std::string>> variables; ///< set beside those of the test
    bool closed_output = false;                                 ///< without a standard output at all
    std::string output_file; ///< where its standard output goes, instead of to the test

    start_options() = default;
};

/// NAME=VALUE of this process and of `options`, for one that is started.
std::vector<std::string> variables_with(const start_options& options);

/// A child process with its three streams on pipes. Destroying it ends it.
class program {
public:
    /// `arguments[0]` is the file; a name without `/` is one of this build's programs. Throws std::runtime_error.
    explicit program(std::vector<std::string> arguments, start_options options = start_options());
    ~program();
    program(const program&) = delete;
    program& operator=(const program&) = delete;

    /// The next line of its standard output, without its end; what is left at the end of the output.
    std::string read_line();
    /// The same of its standard error.
    std::string read_error_line();
    /// Stops reading its standard output: its next write finds no reader.
    void close_output();
    void signal(int number);
    /// Reads everything until it has ended.
    ran wait();

private:
    std::string next_line(std::string& of, const int& from);
    bool pump(); // false once both streams have ended

    int pid_ = -1;
    int out_ = -1, err_ = -1;
    ran so_far_;
};

/// Starts a program and waits for its end.
ran run_program(std::vector<std::string> arguments, start_options options = start_options());

} // namespace ise_test
