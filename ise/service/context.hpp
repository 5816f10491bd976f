#pragma once
#include <ise/core/time.hpp>

#include <asio/any_io_executor.hpp>

#include <cstdint>
#include <string>
#include <string_view>

namespace ise {

/// Ties together the calls that one cause led to.
struct trace_id {
    std::uint64_t trace = 0;  ///< of the whole tree of calls; 0: none
    std::uint64_t parent = 0; ///< the call that led to this one
};

/// What a handler may know of the call it answers. It reaches nested calls by itself: the executor of a handler's
/// coroutine carries it, so a call made there has the smaller of the two deadlines and the same trace.
struct call_context {
    std::string_view service; ///< that was called
    std::string_view caller; ///< the caller's path, or its address if it has none
    time_point deadline = time_point::max(); ///< when nobody waits any more, on the loop's clock
    trace_id trace; ///< what it belongs to
    std::string_view waiting; ///< of an exclusive service: the first caller whose request came while this one ran, and waits. Else empty
};

/// What a call that ran out of time inside `context` has to add: that it may have waited for its own handler. Empty where it did not.
std::string suspected_cycle(const call_context& context);

/// `on`, carrying `context`, which outlives every coroutine on it.
asio::any_io_executor with_context(const asio::any_io_executor& on, const call_context* context);

/// The context that an executor carries, or null.
const call_context* context_of(const asio::any_io_executor& on) noexcept;

} // namespace ise
