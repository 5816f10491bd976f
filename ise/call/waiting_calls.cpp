#include <ise/call/waiting_calls.hpp>

#include <algorithm>

namespace ise {

void waiting_calls::push(waiting_call one) {
    const auto* from = one.from.get();
    auto [at, first] = lines_.try_emplace(from);
    if (first) turns_.push_back(from);
    ++count_;
    bytes_ += one.request.size();
    at->second.bytes += one.request.size();
    at->second.calls.push_back(std::move(one));
}

waiting_call waiting_calls::take(lines::iterator from, std::size_t place) {
    auto& theirs = from->second;
    auto at = theirs.calls.begin() + static_cast<std::ptrdiff_t>(place);
    auto taken = std::move(*at);
    theirs.calls.erase(at);
    --count_;
    bytes_ -= taken.request.size();
    theirs.bytes -= taken.request.size();
    if (theirs.calls.empty()) {
        std::erase(turns_, from->first);
        lines_.erase(from);
    }
    return taken;
}

std::optional<waiting_call> waiting_calls::pop(function_ref<bool(const call_origin&)> may) {
    for (std::size_t turn = 0; turn < turns_.size(); ++turn) {
        const auto* from = turns_[turn];
        if (!may(*from)) continue;
        turns_.erase(turns_.begin() + static_cast<std::ptrdiff_t>(turn));
        turns_.push_back(from);
        return take(lines_.find(from), 0);
    }
    return std::nullopt;
}

std::optional<waiting_call> waiting_calls::overflow(std::size_t most, std::size_t max_bytes) {
    bool too_many = count_ > most;
    if (!too_many && (bytes_ <= max_bytes || count_ <= 1)) return std::nullopt;
    auto smaller = [&](const lines::value_type& a, const lines::value_type& b) {
        return too_many ? a.second.calls.size() < b.second.calls.size() : a.second.bytes < b.second.bytes;
    };
    auto largest = std::max_element(lines_.begin(), lines_.end(), smaller);
    return take(largest, largest->second.calls.size() - 1);
}

void waiting_calls::withdraw(const call_origin& from, std::uint64_t id) {
    auto found = lines_.find(&from);
    if (found == lines_.end()) return;
    auto& calls = found->second.calls;
    auto at = std::ranges::find(calls, id, [](const waiting_call& entry) { return entry.call.id; });
    if (at != calls.end()) auto gone = take(found, static_cast<std::size_t>(at - calls.begin()));
}

std::vector<waiting_call> waiting_calls::take_all() {
    std::vector<waiting_call> all;
    for (auto& [from, theirs] : lines_) std::ranges::move(theirs.calls, std::back_inserter(all));
    *this = {};
    return all;
}

} // namespace ise
