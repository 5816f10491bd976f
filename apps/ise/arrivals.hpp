#pragma once
#include <ise/core/time.hpp>

#include <cstdint>
#include <optional>

namespace ise::cli {

/// When packets arrive: rate and evenness over one window after the other. An interval belongs to the window in which
/// it ends.
class arrivals {
public:
    struct summary {
        std::uint64_t packets = 0;
        std::uint64_t intervals = 0;
        double rate_hz = 0;
        duration mean{};
        duration jitter{}; ///< standard deviation of the intervals
        duration shortest{};
        duration longest{};
    };

    void add(time_point at);
    /// Of what was added since the last `take`, which was `window` ago.
    summary take(duration window);

private:
    std::optional<time_point> last_;
    std::uint64_t packets_ = 0;
    std::uint64_t intervals_ = 0;
    double mean_s_ = 0;
    double squares_ = 0; // sum of squared distances from the mean
    duration shortest_ = duration::max();
    duration longest_{};
};

} // namespace ise::cli
