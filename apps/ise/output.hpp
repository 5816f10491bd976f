#pragma once
#include <ise/component/component.hpp>

#include <exception>
#include <string>

namespace ise::cli {

/// Whoever read standard output has gone (`ise echo … | head -1`): the command ends, quietly.
struct reader_gone : std::exception {};

/// Standard output. A reader that does not read holds up the command, never its component's loop: heartbeats go on
/// and packets wait or are dropped and counted, as the subscription says.
class output {
public:
    /// Completes when `text` was handed to the system. Throws reader_gone; problem(no_output) naming the cause.
    /// Cancellation: terminal; a part may have been written.
    task<> write(component& self, std::string text);

    bool is_terminal() const;
    /// Columns of the terminal; 0 where there is none: lines are as long as they are.
    std::size_t width() const;
};

/// Opens what of 0, 1 and 2 the caller has closed, so that no socket gets one of these numbers, and lets writing to
/// a pipe without reader fail instead of ending the process.
void prepare_standard_streams();

/// A whole line to standard error.
void complain(const std::string& line);

} // namespace ise::cli
