#pragma once
#include <cstdint>
#include <utility>

namespace ise {

/// Connects the calls and packets that have one cause. With `high` a trace has the 128 bits of a W3C trace id.
struct trace_id {
    std::uint64_t trace = 0;  ///< of the whole tree, the lower half; 0: none
    std::uint64_t parent = 0; ///< the span that caused this one
    std::uint64_t high = 0;   ///< the upper half; 0 where a peer of an earlier version passed it on

    explicit operator bool() const noexcept { return trace != 0; }
};

namespace detail {

/// The trace that some code works for.
struct trace_place {
    trace_id trace;
    bool of_call = false; ///< of the call that it handles, which packets taken meanwhile do not change

    void handles_call(const trace_id& of) noexcept {
        of_call = true;
        if (trace || of) [[unlikely]]
            trace = of;
    }
};

/// Of the code that runs on this thread; null: there is no place for one, and so no trace.
extern constinit thread_local trace_place* present_trace;

/// `current_trace`, as long as that code runs.
inline const trace_id& trace_here() noexcept {
    static constexpr trace_id none;
    return present_trace ? present_trace->trace : none;
}

/// While it lives, code that is no coroutine works for another trace.
class trace_scope {
public:
    explicit trace_scope(trace_place place) noexcept : place_(place), before_(std::exchange(present_trace, &place_)) {}
    ~trace_scope() { present_trace = before_; }
    trace_scope(const trace_scope&) = delete;
    trace_scope& operator=(const trace_scope&) = delete;

private:
    trace_place place_;
    trace_place* before_;
};

} // namespace detail

/// The trace that the running handler or coroutine works for: of its call, else of the packet that it took last from a
/// subscription, else the one given to `work_for`. Calls made and packets published here belong to it. On a component's
/// thread.
inline trace_id current_trace() noexcept { return detail::trace_here(); }

/// From here on the running coroutine works for this trace, until it takes the next packet from a subscription: for
/// work that a handler left to it, with the `current_trace()` of then. In a function that is no coroutine until it
/// returns to the library. Does nothing in the coroutine of a handler, which works for its call. On a component's
/// thread.
inline void work_for(const trace_id& trace) noexcept {
    if (detail::present_trace && !detail::present_trace->of_call) detail::present_trace->trace = trace;
}

} // namespace ise
