#include <components/gprs/number_set.hpp>

#include <algorithm>
#include <iterator>

namespace atirma::gprs {

bool number_set::contains(std::uint32_t number) const {
    if (number <= complete_) return true;
    auto after = above_.upper_bound(number);
    return after != above_.begin() && std::prev(after)->second >= number;
}

bool number_set::add(std::uint32_t number) {
    if (contains(number)) return true;
    auto after = above_.upper_bound(number);
    bool joins_after = after != above_.end() && after->first - 1 == number;
    bool joins_before = after != above_.begin() && std::prev(after)->second + 1 == number;
    if (joins_before) {
        auto before = std::prev(after);
        before->second = joins_after ? after->second : number;
        if (joins_after) above_.erase(after);
    } else if (joins_after) {
        auto last = after->second;
        above_.erase(after);
        above_.emplace(number, last);
    } else {
        if (above_.size() >= max_ranges_ && number != complete_ + 1) return false;
        above_.emplace(number, number);
    }
    absorb();
    return true;
}

std::uint64_t number_set::skip_to(std::uint32_t number) {
    if (number <= complete_) return 0;
    std::uint64_t missing = number - complete_;
    while (!above_.empty() && above_.begin()->first <= number) {
        auto [first, last] = *above_.begin();
        missing -= std::min(last, number) - first + 1;
        above_.erase(above_.begin());
        if (last > number) above_.emplace(number + 1, last);
    }
    complete_ = number;
    absorb();
    return missing;
}

void number_set::absorb() {
    if (above_.empty() || above_.begin()->first - 1 != complete_) return;
    complete_ = above_.begin()->second;
    above_.erase(above_.begin());
}

} // namespace atirma::gprs
