#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace bench {

/// Counts durations in buckets that are at most 1/64 apart, so that a sample costs a nanosecond and no allocation.
class histogram {
public:
    void add(std::int64_t duration_ns) noexcept {
        const auto value = static_cast<std::uint64_t>(std::max<std::int64_t>(duration_ns, 0));
        ++counts_[index_of(value)];
        ++samples_;
        sum_ += static_cast<double>(value);
        max_ = std::max(max_, value);
    }

    std::uint64_t samples() const noexcept { return samples_; }
    std::uint64_t max_ns() const noexcept { return max_; }
    double mean_ns() const noexcept { return samples_ == 0 ? 0 : sum_ / static_cast<double>(samples_); }

    /// The middle of the bucket that holds the given share (0..1) of the samples; 0 without samples.
    double quantile_ns(double share) const noexcept {
        if (samples_ == 0) return 0;
        const auto wanted =
            std::max<std::uint64_t>(1, static_cast<std::uint64_t>(share * static_cast<double>(samples_) + 0.5));
        std::uint64_t seen = 0;
        for (std::size_t i = 0; i != counts_.size(); ++i) {
            seen += counts_[i];
            if (seen >= wanted) return middle_of(i);
        }
        return static_cast<double>(max_);
    }

private:
    static constexpr unsigned sub_bits = 6;
    static constexpr std::uint64_t sub_count = 1U << sub_bits;

    static std::size_t index_of(std::uint64_t value) noexcept {
        if (value < sub_count) return static_cast<std::size_t>(value);
        const auto shift = static_cast<unsigned>(std::bit_width(value)) - sub_bits - 1;
        return static_cast<std::size_t>((shift + 1) * sub_count + ((value >> shift) - sub_count));
    }

    static double middle_of(std::size_t index) noexcept {
        if (index < sub_count) return static_cast<double>(index);
        const auto shift = index / sub_count - 1;
        const auto low = (sub_count + index % sub_count) << shift;
        return static_cast<double>(low) + static_cast<double>(std::uint64_t{1} << shift) / 2;
    }

    std::array<std::uint64_t, (64 - sub_bits + 1) * sub_count> counts_{};
    std::uint64_t samples_ = 0;
    std::uint64_t max_ = 0;
    double sum_ = 0;
};

} // namespace bench
