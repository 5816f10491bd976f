#pragma once
#include "histogram.hpp"
#include "options.hpp"

#include <cstdint>

namespace bench {

/// What one run measured.
struct outcome {
    std::uint64_t count = 0; ///< calls answered, or messages received by all subscribers together
    double seconds = 0;      ///< the time in which they were
    histogram latency;       ///< of each call or message where it is known, else empty
    double bytes_each = 0;   ///< idle: what one connection costs the serving process
    double resident_bytes_each = 0;
};

/// The latencies as JSON: quantiles, and for a picture of the distribution some more under `at`.
void print_latency(const histogram& latency);

/// One line of JSON on standard output, as bench/README.md describes it.
void print(const options& asked, const outcome& found);

std::int64_t now_ns() noexcept;

/// Ends this process as soon as its standard input does, so that no server outlives the one who started it.
void end_with_standard_input();

/// Tells the one who started this process where it can be reached.
void announce(const std::string& address);

} // namespace bench
