#include <components/gprs/freshness.hpp>

#include <algorithm>

namespace atirma::gprs {

bool freshness::is_history(bool told, std::uint16_t boot, std::uint8_t type, std::uint32_t sequence) {
    if (told) return true;
    if (!any_ || boot != boot_) {
        if (std::find(past_.begin(), past_.end(), boot) != past_.end()) return true; // of a life that is over
        if (any_) past_.push_back(boot_);
        if (past_.size() > remembered_boots) past_.pop_front();
        any_ = true;
        boot_ = boot;
        next_.fill(0);
    }
    auto& next = next_[type];
    if (sequence < next) return true;
    next = std::uint64_t{sequence} + 1;
    return false;
}

} // namespace atirma::gprs
