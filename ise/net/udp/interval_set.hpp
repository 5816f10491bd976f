#pragma once
#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>

namespace ise::net::udp {

/// Numbers, kept as disjoint half-open intervals: [begin, end).
class interval_set {
public:
    void add(std::uint64_t begin, std::uint64_t end) {
        if (begin >= end) return;
        auto at = all_.upper_bound(begin);
        if (at != all_.begin() && std::prev(at)->second >= begin) {
            --at;
            begin = at->first;
        }
        while (at != all_.end() && at->first <= end) {
            end = std::max(end, at->second);
            at = all_.erase(at);
        }
        all_.emplace_hint(at, begin, end);
    }

    void remove(std::uint64_t begin, std::uint64_t end) {
        auto at = all_.upper_bound(begin);
        if (at != all_.begin()) --at;
        while (at != all_.end() && at->first < end) {
            auto [from, to] = *at;
            if (to <= begin) {
                ++at;
                continue;
            }
            at = all_.erase(at);
            if (from < begin) all_.emplace(from, begin);
            if (to > end) at = all_.emplace(end, to).first;
        }
    }

    bool contains(std::uint64_t number) const noexcept {
        auto at = all_.upper_bound(number);
        return at != all_.begin() && std::prev(at)->second > number;
    }
    /// Whether `number` would stand alone: neither in, nor beside, an interval.
    bool apart(std::uint64_t begin, std::uint64_t end) const noexcept {
        auto at = all_.upper_bound(begin);
        if (at != all_.begin() && std::prev(at)->second >= begin) return false;
        return at == all_.end() || at->first > end;
    }

    bool empty() const noexcept { return all_.empty(); }
    std::size_t intervals() const noexcept { return all_.size(); }
    const std::map<std::uint64_t, std::uint64_t>& all() const noexcept { return all_; }
    void drop_first() { all_.erase(all_.begin()); }
    void clear() noexcept { all_.clear(); }

private:
    std::map<std::uint64_t, std::uint64_t> all_; // begin, end
};

} // namespace ise::net::udp
