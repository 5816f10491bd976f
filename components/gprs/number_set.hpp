#pragma once
#include <cstddef>
#include <cstdint>
#include <map>

namespace atirma::gprs {

/// Which of the numbers 1, 2, 3 … are there: all up to `complete()`, and some above. In bounded memory, exact.
class number_set {
public:
    explicit number_set(std::size_t max_ranges = 1024) : max_ranges_(max_ranges) {}

    /// False where it cannot be remembered now: too many holes below it.
    bool add(std::uint32_t number);
    bool contains(std::uint32_t number) const;
    /// All up to this one are there.
    std::uint32_t complete() const noexcept { return complete_; }
    /// The highest that is there.
    std::uint32_t highest() const noexcept { return above_.empty() ? complete_ : above_.rbegin()->second; }
    /// From now on all up to `number` count as there. How many of those were not.
    std::uint64_t skip_to(std::uint32_t number);

private:
    void absorb();

    std::size_t max_ranges_;
    std::uint32_t complete_ = 0;
    std::map<std::uint32_t, std::uint32_t> above_; // first → last, apart from each other
};

} // namespace atirma::gprs
