#pragma once
#include <ise/core/log.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/stream.hpp>
#include <ise/core/task.hpp>
#include <ise/net/fair_places.hpp>

#include <functional>
#include <memory>
#include <string>

namespace ise::net {

/// A connection that was accepted. `line` outlives `place`, or replaces what the place does when it is displaced.
struct admitted {
    std::unique_ptr<stream> line;
    std::unique_ptr<fair_places::place> place; ///< displaced, it closes `line`. Null where there is none
    bool refused = false;                      ///< every place is taken: close it, or tell the peer so
};

/// Hears of each failure to accept: what, and at which listener.
using accept_reporter = std::function<void(const std::string& what, const std::string& at)>;

/// Logs failures to accept as warnings, limited in rate. `on` outlives it.
accept_reporter log_to(loop& on, logger log);

/// The accept loop of every listener: passes each connection to `take`, until the listener is closed. What passes does
/// not end it: out of descriptors, memory or buffers, a connection that was aborted. Out of descriptors, a place that
/// waits makes way. `places` is null where the user bounds its connections in another way; it outlives the loop.
/// Cancellation: terminal, as after a close.
task<> accept_each(loop& on, std::shared_ptr<listener> from, fair_places* places, accept_reporter report,
                   std::function<void(admitted)> take);

} // namespace ise::net
