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
    std::unique_ptr<stream> line;              ///< null: the listener was closed
    std::unique_ptr<fair_places::place> place; ///< displaced, it closes `line`. Null where there is none
    bool refused = false;                      ///< every place is taken: close it, or tell the peer so
};

/// The accept loop of every listener. What passes does not end it: out of descriptors, memory or buffers, a connection
/// that was aborted. Out of descriptors, a place that waits makes way. Used on one loop.
class bounded_acceptor {
public:
    /// Hears of each failure to accept; limits the rate itself.
    using reporter = std::function<void(const std::string& what, const std::string& at)>;

    /// `places` is null where the user bounds its connections in another way; it outlives the acceptor.
    bounded_acceptor(loop& on, std::shared_ptr<listener> from, fair_places* places, reporter report)
        : on_(on), from_(std::move(from)), places_(places), report_(std::move(report)) {}

    /// The next connection; one without a line once the listener is closed. Cancellation: terminal, as after a close.
    task<admitted> next();

private:
    loop& on_;
    std::shared_ptr<listener> from_;
    fair_places* places_;
    reporter report_;
};

/// Logs failures to accept as warnings, limited in rate. `on` outlives it.
bounded_acceptor::reporter log_to(loop& on, logger log);

/// Accepts until the listener is closed, and passes each connection to `take`. Parameters as of `bounded_acceptor`.
/// Cancellation: terminal, ends it.
task<> accept_each(loop& on, std::shared_ptr<listener> from, fair_places* places, bounded_acceptor::reporter report,
                   std::function<void(admitted)> take);

} // namespace ise::net
