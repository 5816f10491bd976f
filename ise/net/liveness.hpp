#pragma once
#include <ise/core/time.hpp>

namespace ise::net {

/// When each side of a connection was heard last: whether the peer is lost, and whether it is to be sent a ping.
/// Decides by the times that it is told, without I/O.
class liveness {
public:
    /// `ours`: the period in which the peer promised to be heard.
    liveness(duration ours, time_point now) noexcept : ours_(ours), heard_(now), sent_(now) {}

    struct verdict {
        bool lost = false;       ///< the peer was silent for three periods
        bool ping = false;       ///< it counts as sent
        time_point look_again{}; ///< unless it is lost
    };
    /// Looks at the connection. `theirs`: the period in which the peer wants to hear something.
    verdict look(time_point now, duration theirs) noexcept;

    void heard(time_point now) noexcept { heard_ = now; }
    void sent(time_point now) noexcept { sent_ = now; }
    /// A ping of that time was answered.
    void answered(duration took) noexcept { round_trip_ = took; }

    time_point last_heard() const noexcept { return heard_; }
    time_point last_sent() const noexcept { return sent_; }
    /// The last one that was measured; zero before the first.
    duration round_trip() const noexcept { return round_trip_; }

private:
    duration ours_;
    time_point heard_;
    time_point sent_;
    time_point pinged_{};
    time_point due_{}; // of the next look
    duration round_trip_{};
};

} // namespace ise::net
