#pragma once
#include "subscription.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace ise::cli {

/// What a command prints for each window of time.
class window_printer {
public:
    virtual ~window_printer() = default;
    /// Above the rows, for people.
    virtual std::string heading() const { return {}; }
    /// The window that has just ended, `length` long: rows for people, with --json a line. Throws problem if there is
    /// no answer.
    virtual task<std::string> take(duration length, bool last) = 0;
    /// Called when that was written. Throws problem if there is nothing more to measure.
    virtual void check() const {}
};

/// The loop of hz, bw, delay and top: waits for the end of each window and prints it, `count` times or until the user
/// ends it. A window that could not be printed in time makes the next one longer. Cancellation: terminal.
task<> print_windows(context& in, duration window, std::optional<std::uint64_t> count, window_printer& of);

/// Options of the commands that measure the packets of a subscription.
struct metering_options {
    subscribe_choice what;
    duration window = std::chrono::seconds(1);
    std::optional<std::uint64_t> count; ///< windows until it ends
};
void add_metering(command_line::app& app, metering_options& into);
/// To be called when the command line was read.
void complete_metering(metering_options& of, parsed_command& made);

/// What measures packets.
class gauge {
public:
    virtual ~gauge() = default;
    virtual void see(const received<dynamic_packet>& packet, time_point at) = 0;
    virtual std::string heading() const = 0;
    /// Of a window that is over, and a new one begins: a row for people, or a line of JSON.
    virtual std::string row(duration window, const dynamic_stream& stream) = 0;
    virtual std::string json(duration window, const dynamic_stream& stream) = 0;
};

/// Subscribes, gives every packet to `to` and prints what it says, window by window. Ends by its count, or with the
/// subscription, whose cause it throws as a problem. `to` outlives the command.
task<> measure(context& in, metering_options options, std::shared_ptr<gauge> to);

/// What was lost so far, for a row.
std::string show_losses(const dynamic_stream& stream);

} // namespace ise::cli
