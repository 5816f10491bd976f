#include <ise/service/run_tap.hpp>

#include <algorithm>

namespace ise {

void run_taps::watch(const service_runtime& component, std::function<void(tapped_run)> observer) {
    ignore(component);
    observers_.emplace_back(&component, std::move(observer));
}

void run_taps::ignore(const service_runtime& component) {
    std::erase_if(observers_, [&](const auto& one) { return one.first == &component; });
}

const std::function<void(tapped_run)>* run_taps::find(const service_runtime& component) const noexcept {
    auto found = std::ranges::find_if(observers_, [&](const auto& one) { return one.first == &component; });
    return found == observers_.end() ? nullptr : &found->second;
}

} // namespace ise
