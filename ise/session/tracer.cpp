#include <ise/session/tracer.hpp>

#include <algorithm>
#include <limits>
#include <utility>

namespace ise {

namespace {

std::optional<std::uint64_t> threshold_of(std::optional<double> rate) noexcept {
    constexpr auto max_number = std::numeric_limits<std::uint64_t>::max();
    if (!rate) return std::nullopt;
    if (!(*rate > 0)) return 0; // ids are never 0
    return *rate >= 1 ? max_number : static_cast<std::uint64_t>(*rate * 0x1p64);
}

// SplitMix64: every state gives another number, never 0.
constexpr std::uint64_t id_step = 0x9e3779b97f4a7c15;
constexpr std::uint64_t id_of(std::uint64_t state) noexcept {
    auto mixed = state;
    mixed = (mixed ^ (mixed >> 30)) * 0xbf58476d1ce4e5b9;
    mixed = (mixed ^ (mixed >> 27)) * 0x94d049bb133111eb;
    mixed ^= mixed >> 31;
    return mixed != 0 ? mixed : id_step;
}

} // namespace

tracer::tracer(std::optional<double> rate, std::uint64_t seed) : threshold_(threshold_of(rate)), state_(seed) {}

std::uint64_t tracer::next_id() noexcept {
    return id_of(state_.fetch_add(id_step, std::memory_order_relaxed) + id_step);
}

trace_id numbered_trace(std::string_view what, std::uint64_t number) noexcept {
    std::uint64_t state = 0xcbf29ce484222325; // FNV-1a
    for (char one : what) state = (state ^ static_cast<unsigned char>(one)) * 0x100000001b3;
    state = id_of(state + number * id_step);
    trace_id made;
    made.trace = id_of(state += id_step);
    made.high = id_of(state += id_step);
    made.parent = id_of(state += id_step);
    return made;
}

void tracer::ended(const trace_id& in, std::uint64_t id, span::side of, errc outcome, time_point began, duration took,
                   std::string_view service, std::string_view component, std::string_view peer,
                   const trace_id& linked) {
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
    made.linked = linked;
}

std::vector<span> tracer::take(std::vector<span> back) {
    left_.store(usual_traces, std::memory_order_relaxed);
    std::lock_guard lock(mutex_);
    std::swap(spans_, back);
    back.resize(std::exchange(count_, 0));
    return back;
}

} // namespace ise
