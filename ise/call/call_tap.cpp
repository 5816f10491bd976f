#include <ise/call/call_tap.hpp>

#include <algorithm>

namespace ise {

std::atomic<unsigned> call_taps::watched_components{0};

call_taps::~call_taps() { watched_components -= static_cast<unsigned>(observers_.size()); }

void call_taps::watch(const service_runtime& component, std::function<void(tapped_call)> observer) {
    ignore(component);
    observers_.emplace_back(&component, std::move(observer));
    ++watched_components;
}

bool call_taps::watches(const service_runtime& component) const noexcept {
    return std::ranges::any_of(observers_, [&](const auto& one) { return one.first == &component; });
}

void call_taps::ignore(const service_runtime& component) {
    watched_components -=
        static_cast<unsigned>(std::erase_if(observers_, [&](const auto& one) { return one.first == &component; }));
}

void call_taps::begin(const void* session, std::uint64_t id, tapped_call call, time_point at) {
    calls_[{session, id}] = running{std::move(call), at};
}

void call_taps::end(const void* session, std::uint64_t id, const service_runtime& component, time_point at,
                    std::string outcome, std::string message, bytes response) {
    auto found = calls_.find({session, id});
    if (found == calls_.end()) return;
    auto call = std::move(found->second.call);
    call.took = at - found->second.began;
    calls_.erase(found);
    call.outcome = std::move(outcome);
    call.message = std::move(message);
    call.response = std::move(response);
    for (const auto& [of, observer] : observers_)
        if (of == &component) return observer(std::move(call));
}

} // namespace ise
