#pragma once
#include "subscribing.hpp"

#include <functional>
#include <string>

namespace ise::cli {

/// What measures the packets of a subscription.
class gauge {
public:
    virtual ~gauge() = default;
    virtual void see(const dynamic_packet& packet) = 0;
    virtual std::string heading() const = 0;
    /// Of a window that is over, and a new one begins: a row for people, or a line of JSON.
    virtual std::string row(duration window, const dynamic_stream& stream) = 0;
    virtual std::string json(duration window, const dynamic_stream& stream) = 0;
};

/// Subscribes, gives every packet to `to` and prints what it says, window by window. Ends by its count, or with the
/// subscription, whose cause it throws as a problem. `to` outlives the command.
task<> measure(context& in, hz_options options, std::shared_ptr<gauge> to);

/// What was lost so far, for a row.
std::string show_losses(const dynamic_stream& stream);

} // namespace ise::cli
