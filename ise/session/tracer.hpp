#pragma once
#include <ise/core/error.hpp>
#include <ise/core/time.hpp>
#include <ise/core/trace_id.hpp>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace ise {

/// One side of a call, once it has ended, or of a published packet, or work of a component's own.
struct span {
    /// A producer's lasts no time; a consumer's from the arrival of the packet until it was taken.
    enum class side : std::uint8_t { client, server, producer, consumer, internal };

    trace_id in;          ///< `parent`: the span that caused it; 0: it is the root
    std::uint64_t id = 0; ///< its own
    side of = side::client;
    errc outcome{};        ///< zero: answered
    time_point began{};    ///< on the process's monotonic clock
    duration took{};       ///< of a server: from the request to the answer, the wait for a handler included
    std::string service;   ///< of the call or packet; else the name of the work
    std::string component; ///< the path of this side; empty: anonymous
    std::string peer;      ///< the other side: its path, or its address; empty: none
    trace_id linked;       ///< a span of another trace that goes on with it: its trace, and the span in `parent`
};

/// Begins traces and collects spans, for the components of one process. What nobody takes is bounded; what does not
/// fit is dropped and counted. Thread-safe.
class tracer {
public:
    static constexpr std::size_t max_spans = 8192; ///< that wait to be taken

    static constexpr std::uint32_t usual_traces = 100; ///< kept between two `take()`, without a rate

    /// `rate`: of the traces that begin here so many are kept, from 0 to 1; without one the first `usual_traces` of the
    /// time between two `take()`. `seed`: of their numbers.
    tracer(std::optional<double> rate, std::uint64_t seed);
    tracer(const tracer&) = delete;
    tracer& operator=(const tracer&) = delete;

    /// A call begins: where it belongs to a trace or begins one, `in.parent` becomes its own span, `caused_by` the one
    /// before, and the result is true. `in_handler`: what its caller did not trace is not traced from here on.
    bool begin_call(trace_id& in, std::uint64_t& caused_by, bool in_handler) noexcept {
        caused_by = in.parent;
        if (in.trace == 0) {
            if (in_handler || !samples()) return false;
            in.trace = next_id();
            in.high = next_id();
        }
        in.parent = next_id();
        return true;
    }
    /// A number that no other span has; never 0.
    std::uint64_t next_id() noexcept;

    /// A span has ended. The texts are copied.
    void ended(const trace_id& in, std::uint64_t id, span::side of, errc outcome, time_point began, duration took,
               std::string_view service, std::string_view component, std::string_view peer,
               const trace_id& linked = trace_id());

    /// Spans that ended since the last time, in the order of their ends. `back`: those taken before, whose memory is
    /// used again.
    std::vector<span> take(std::vector<span> back = {});
    std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); } ///< since it was made
    void drop(std::uint64_t count) noexcept { dropped_ += count; } ///< taken, and then not exported

private:
    bool samples() noexcept {
        if (threshold_) return next_id() <= *threshold_;
        if (left_.load(std::memory_order_relaxed) <= 0) return false;
        return left_.fetch_sub(1, std::memory_order_relaxed) > 0;
    }

    const std::optional<std::uint64_t> threshold_;
    std::atomic<std::int32_t> left_{usual_traces};
    std::atomic<std::uint64_t> state_;
    std::atomic<std::uint64_t> dropped_{0};
    std::mutex mutex_;
    std::vector<span> spans_; // the first count_ are in use
    std::size_t count_ = 0;
};

/// The trace of something that has a number where nothing longer fits, such as a message over a radio: the same at both
/// ends, who need not know of each other. Its `parent` is the span of what is done with it there.
trace_id numbered_trace(std::string_view what, std::uint64_t number) noexcept;

} // namespace ise
