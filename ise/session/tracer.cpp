#include <ise/session/tracer.hpp>

#include <algorithm>
#include <limits>
#include <utility>

namespace ise {

std::atomic<unsigned> tracer::tracers{0};

namespace {

std::uint64_t threshold_of(double rate) noexcept {
    constexpr auto most = std::numeric_limits<std::uint64_t>::max();
    if (!(rate > 0)) return 0; // ids are never 0
    return rate >= 1 ? most : static_cast<std::uint64_t>(rate * 0x1p64);
}

} // namespace

tracer::tracer(double rate, std::uint64_t seed) : threshold_(threshold_of(rate)), state_(seed) { ++tracers; }

tracer::~tracer() { --tracers; }

// SplitMix64: every state gives another number.
std::uint64_t tracer::next_id() noexcept {
    constexpr std::uint64_t step = 0x9e3779b97f4a7c15;
    auto mixed = state_.fetch_add(step, std::memory_order_relaxed) + step;
    mixed = (mixed ^ (mixed >> 30)) * 0xbf58476d1ce4e5b9;
    mixed = (mixed ^ (mixed >> 27)) * 0x94d049bb133111eb;
    mixed ^= mixed >> 31;
    return mixed != 0 ? mixed : step;
}

void tracer::ended(const trace_id& in, std::uint64_t id, span::side of, errc outcome, time_point began, duration took,
                   std::string_view service, std::string_view component, std::string_view peer) {
    std::lock_guard lock(mutex_);
    if (count_ == max_spans) {
        drop(1);
        return;
    }
    if (count_ == spans_.size()) spans_.resize(std::min(max_spans, std::max<std::size_t>(64, 2 * count_)));
    auto& made = spans_[count_++];
    made.in = in;
    made.id = id;
    made.of = of;
    made.outcome = outcome;
    made.began = began;
    made.took = took;
    made.service.assign(service);
    made.component.assign(component);
    made.peer.assign(peer);
}

std::vector<span> tracer::take(std::vector<span> back) {
    std::lock_guard lock(mutex_);
    std::swap(spans_, back);
    back.resize(std::exchange(count_, 0));
    return back;
}

} // namespace ise
