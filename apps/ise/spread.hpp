#pragma once
#include <ise/core/time.hpp>

#include <cstddef>
#include <vector>

namespace ise::cli {

/// Lengths of time that were measured, in a bounded number: of more only the first count for the median.
class spread {
public:
    void add(duration length);
    std::size_t count() const noexcept { return count_; }
    /// Only where `count()` is not zero, as all that follows.
    duration shortest() const noexcept { return shortest_; }
    duration longest() const noexcept { return longest_; }
    duration median() const;

private:
    std::vector<duration> kept_;
    std::size_t count_ = 0;
    duration shortest_ = duration::max(), longest_ = duration::min();
};

} // namespace ise::cli
