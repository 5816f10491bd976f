#pragma once
#include <ise/core/time.hpp>

namespace ise::real {

/// Whether it pays for a loop to look for events again and again instead of sleeping until the next one comes. Decides
/// from what it is told; without a clock and without I/O.
///
/// It pays where what came was found by looking. It does not where nothing came within the window, or where another
/// thread needed the core meanwhile: `patience` times in a row, and it rests for some events, longer each time it tries
/// again in vain.
class poll_policy {
public:
    static constexpr unsigned patience = 3;
    static constexpr unsigned first_rest = 16; ///< events
    static constexpr unsigned max_rest = 1024;
    /// Nobody sleeps between two looks: a gap like this has another cause.
    static constexpr duration hiccup = std::chrono::microseconds(2);

    /// `window`: how long it looks for the next event before it sleeps.
    explicit poll_policy(duration window) noexcept : window_(window) {}

    /// Something came. Whether to look for what follows.
    bool on_event() noexcept;
    /// A look found nothing. Whether to look again; else sleep.
    bool on_nothing(time_point now) noexcept;
    /// Whether so much time has passed since the last look that somebody else may have had the core.
    bool suspicious(time_point now) const noexcept { return looks_ > 0 && now - last_look_ > hiccup; }
    /// Somebody had it.
    void on_preempted() noexcept { preempted_ = true; }
    /// There is no core for it.
    void on_refused() noexcept;

    bool looking() const noexcept { return looking_; }

private:
    void lose() noexcept;

    duration window_;
    time_point began_{}, last_look_{};
    unsigned looks_ = 0; // since the last event
    unsigned lost_ = 0;  // times in a row that it did not pay
    unsigned rest_ = first_rest;
    unsigned resting_ = 0; // events that are still to pass
    bool looking_ = false;
    bool preempted_ = false; // since the last event
};

} // namespace ise::real
