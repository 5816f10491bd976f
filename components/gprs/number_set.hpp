#pragma once
#include <ise/core/interval_set.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace atirma::gprs {

/// Which of the numbers 1, 2, 3 … are there: all up to `complete()`, and some above. In bounded memory, exact.
class number_set {
public:
    explicit number_set(std::size_t max_ranges = 1024) : max_ranges_(max_ranges) { there_.add(0, 1); }

    /// False where it cannot be remembered now: too many holes below it.
    bool add(std::uint32_t number) {
        auto at = std::uint64_t{number};
        if (contains(number)) return true;
        if (there_.intervals() > max_ranges_ && there_.apart(at, at + 1)) return false;
        there_.add(at, at + 1);
        return true;
    }
    void remove(std::uint32_t number) { there_.remove(number, std::uint64_t{number} + 1); }
    bool contains(std::uint32_t number) const { return there_.contains(number); }
    /// All up to this one are there.
    std::uint32_t complete() const noexcept { return static_cast<std::uint32_t>(there_.all().front().second - 1); }
    /// The highest that is there.
    std::uint32_t highest() const noexcept { return static_cast<std::uint32_t>(there_.all().back().second - 1); }
    /// From now on all up to `number` count as there. How many of those were not.
    std::uint64_t skip_to(std::uint32_t number) {
        auto end = std::uint64_t{number} + 1, missing = end;
        for (auto [from, to] : there_.all()) missing -= std::min(to, end) - std::min(from, end);
        there_.add(0, end);
        return missing;
    }

private:
    std::size_t max_ranges_;
    ise::interval_set there_; // the first one begins with 0
};

} // namespace atirma::gprs
