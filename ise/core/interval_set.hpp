#pragma once
#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace ise {

/// Numbers, kept as disjoint half-open intervals: [begin, end). Few of them: side by side, and no allocation as long as
/// they do not become more than they were.
class interval_set {
public:
    using interval = std::pair<std::uint64_t, std::uint64_t>;

    void add(std::uint64_t begin, std::uint64_t end) {
        if (begin >= end) return;
        if (!all_.empty() && all_.back().second == begin) { // the next ones, as mostly
            all_.back().second = end;
            return;
        }
        auto first = reaching(begin);
        auto last = first;
        for (; last != all_.end() && last->first <= end; ++last) {
            begin = std::min(begin, last->first);
            end = std::max(end, last->second);
        }
        if (first == last) {
            all_.emplace(first, begin, end);
        } else {
            *first = {begin, end};
            all_.erase(first + 1, last);
        }
    }

    void remove(std::uint64_t begin, std::uint64_t end) {
        if (begin >= end) return;
        auto at = reaching(begin + 1);
        if (at == all_.end() || at->first >= end) return;
        if (at->first < begin) {
            auto to = std::exchange(at->second, begin);
            ++at;
            if (to > end) {
                all_.emplace(at, end, to);
                return;
            }
        }
        auto last = at;
        while (last != all_.end() && last->second <= end) ++last;
        at = all_.erase(at, last);
        if (at != all_.end() && at->first < end) at->first = end;
    }

    bool contains(std::uint64_t number) const noexcept {
        auto at = std::upper_bound(all_.begin(), all_.end(), number,
                                   [](std::uint64_t wanted, const interval& one) { return wanted < one.second; });
        return at != all_.end() && at->first <= number;
    }
    /// Whether [begin, end) would stand alone: neither in, nor beside, an interval.
    bool apart(std::uint64_t begin, std::uint64_t end) noexcept {
        auto at = reaching(begin);
        return at == all_.end() || at->first > end;
    }

    bool empty() const noexcept { return all_.empty(); }
    std::size_t intervals() const noexcept { return all_.size(); }
    /// In ascending order.
    const std::vector<interval>& all() const noexcept { return all_; }
    void drop_first() { all_.erase(all_.begin()); }

private:
    // The first interval that ends at `number` or behind it.
    std::vector<interval>::iterator reaching(std::uint64_t number) noexcept {
        return std::lower_bound(all_.begin(), all_.end(), number,
                                [](const interval& one, std::uint64_t wanted) { return one.second < wanted; });
    }

    std::vector<interval> all_;
};

} // namespace ise
