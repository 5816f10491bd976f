#pragma once
#include <ise/core/error.hpp>
#include <ise/core/time.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <numeric>
#include <utility>
#include <vector>

namespace ise {

/// How long something took, counted in buckets each a quarter of a doubling wide, from a microsecond to two minutes;
/// what is longer counts as that. Adding costs a shift and an increment.
class duration_histogram {
public:
    static constexpr std::size_t buckets = 108; ///< how many there are

    void add(duration took) noexcept {
        ++counts_[bucket_of(took)];
        sum_ += took;
    }
    duration sum() const noexcept { return sum_; } ///< of all that was added
    std::uint64_t count(std::size_t bucket) const noexcept { return counts_[bucket]; }
    std::uint64_t count() const noexcept { return std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0}); }

    static constexpr std::size_t bucket_of(duration took) noexcept {
        auto units = static_cast<std::uint64_t>(std::max<std::int64_t>(took.count(), 0)) >> unit_bits;
        if (units < 4) return static_cast<std::size_t>(units);
        auto octave = static_cast<std::size_t>(std::bit_width(units)) - 1;
        return std::min((octave - 1) * 4 + static_cast<std::size_t>((units >> (octave - 2)) & 3), buckets - 1);
    }
    /// Whatever counts there was shorter than this (but for the last bucket).
    static constexpr duration end_of(std::size_t bucket) noexcept {
        std::uint64_t units = bucket < 4 ? bucket + 1 : (std::uint64_t{5} + bucket % 4) << (bucket / 4 - 1);
        return duration(static_cast<std::int64_t>(units << unit_bits));
    }

private:
    static constexpr int unit_bits = 10; // 1.024 µs
    std::array<std::uint64_t, buckets> counts_{};
    duration sum_{};
};

/// How many calls failed, by the reason: few, since the reasons are an enumeration.
class outcome_counts {
public:
    void add(errc why) noexcept {
        for (auto& [code, count] : counts_)
            if (code == why) return void(++count);
        try {
            counts_.emplace_back(why, 1);
        } catch (const std::bad_alloc&) { // a figure less
        }
    }
    const std::vector<std::pair<errc, std::uint64_t>>& all() const noexcept { return counts_; }

private:
    std::vector<std::pair<errc, std::uint64_t>> counts_; // those that occurred
};

/// A provided request-response service in figures. Every call is counted, and how long it waited for a handler. How
/// long a handler took is measured for every call that waited, and else for the first one after a pause of 100 µs:
/// while nothing waits, the clock is read for 10,000 calls a second at most.
class service_meter {
public:
    static constexpr duration pause = std::chrono::microseconds(100);

    /// A request came: whether its handling is to be measured if it begins at once; that of the first one is. `turn`:
    /// the loop's time.
    bool samples(time_point turn) {
        if (turn < next_) return false;
        if (!took_) [[unlikely]]
            took_ = std::make_unique<both>();
        next_ = saturating_add(turn, pause);
        return true;
    }
    /// A handler begins with it, after that wait.
    void begins(duration wait = duration{}) noexcept { took_->waited.add(wait); }
    void handled(duration took) noexcept { took_->handled.add(took); }
    void refused_overloaded() noexcept { ++overloaded_; }
    void refused_expired() noexcept { ++expired_; }

    void answered() noexcept { ++answered_; }
    /// Answered by a failure, or given up by its caller (errc::cancelled).
    void failed(errc why) noexcept { failures_.add(why); }

    std::uint64_t answered_calls() const noexcept { return answered_; } ///< with a response
    const outcome_counts& failures() const noexcept { return failures_; }
    /// That a handler began with.
    std::uint64_t calls() const noexcept { return took_ ? took_->waited.count() : 0; }
    std::uint64_t overloaded() const noexcept { return overloaded_; } ///< refused: too many waited
    std::uint64_t expired() const noexcept {
        return expired_;
    } ///< refused: their deadline came before a handler was free
    /// Null before the first call.
    const duration_histogram* handling() const noexcept { return took_ ? &took_->handled : nullptr; }
    const duration_histogram* waiting() const noexcept { return took_ ? &took_->waited : nullptr; }

private:
    struct both {
        duration_histogram handled, waited;
    };
    std::unique_ptr<both> took_; // most services of most components are never called
    time_point next_ = time_point::min();
    std::uint64_t overloaded_ = 0, expired_ = 0, answered_ = 0;
    outcome_counts failures_;
};

} // namespace ise
