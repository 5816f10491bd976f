#pragma once
#include <ise/core/error.hpp>
#include <ise/core/time.hpp>
#include <ise/core/trace_id.hpp>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace ise {

/// One side of a call, once it has ended, or of a published packet.
struct span {
    /// A producer's lasts no time; a consumer's from the arrival of the packet until it was taken.
    enum class side : std::uint8_t { client, server, producer, consumer };

    trace_id in;          ///< `parent`: the span that caused it; 0: it is the root
    std::uint64_t id = 0; ///< its own
    side of = side::client;
    errc outcome{};        ///< zero: answered
    time_point began{};    ///< on the process's monotonic clock
    duration took{};       ///< of a server: from the request to the answer, the wait for a handler included
    std::string service;   ///< of the call or packet
    std::string component; ///< the path of this side; empty: anonymous
    std::string peer;      ///< the other side: its path, or its address
};

/// Begins traces and collects spans, for the components of one process. What nobody takes is bounded; what does not
/// fit is dropped and counted. Thread-safe.
class tracer {
public:
    static constexpr std::size_t max_spans = 8192; ///< that wait to be taken

    /// `rate`: of the traces that begin here so many are kept, from 0 to 1. `seed`: of their numbers.
    tracer(double rate, std::uint64_t seed);
    ~tracer();
    tracer(const tracer&) = delete;
    tracer& operator=(const tracer&) = delete;

    /// Whether a process has one: without, a call costs this look more.
    static bool any() noexcept { return tracers.load(std::memory_order_relaxed) != 0; }

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
               std::string_view service, std::string_view component, std::string_view peer);

    /// Spans that ended since the last time, in the order of their ends. `back`: those taken before, whose memory is
    /// used again.
    std::vector<span> take(std::vector<span> back = {});
    std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); } ///< since it was made
    void drop(std::uint64_t count) noexcept { dropped_ += count; } ///< taken, and then not exported

private:
    static std::atomic<unsigned> tracers;

    bool samples() noexcept { return next_id() <= threshold_; }

    const std::uint64_t threshold_;
    std::atomic<std::uint64_t> state_;
    std::atomic<std::uint64_t> dropped_{0};
    std::mutex mutex_;
    std::vector<span> spans_; // the first count_ are in use
    std::size_t count_ = 0;
};

} // namespace ise
