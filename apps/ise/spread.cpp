#include "spread.hpp"

#include <algorithm>

namespace ise::cli {

void spread::add(duration length) {
    constexpr std::size_t most = 65536;
    ++count_;
    shortest_ = std::min(shortest_, length);
    longest_ = std::max(longest_, length);
    if (kept_.size() < most) kept_.push_back(length);
}

duration spread::median() const {
    auto sorted = kept_;
    auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    if (sorted.size() % 2 == 1) return *middle;
    auto below = *std::max_element(sorted.begin(), middle);
    return below + (*middle - below) / 2;
}

} // namespace ise::cli
