#include <ise/call/pending_call.hpp>

#include <string>
#include <utility>

namespace ise {
namespace {

// A record that is used again keeps no more room for a request than this.
constexpr std::size_t kept_capacity = 4096;

} // namespace

pending_call::pending_call(pending_calls& of)
    : desk(of), alarm(of.on(), [this] { desk.give_up(*this, errc::timed_out); }) {}

void pending_call::drop() noexcept {
    alarm.disarm();
    waiter->call_ = nullptr;
    std::exchange(waiter, nullptr)->drop();
}

void pending_call_list::push_back(pending_call& call) noexcept {
    call.previous = last_;
    (last_ ? last_->next : first_) = &call;
    last_ = &call;
    ++size_;
}

pending_call& pending_call_list::pop_front() noexcept {
    auto& call = *first_;
    remove(call);
    return call;
}

void pending_call_list::remove(pending_call& call) noexcept {
    if (!call.previous && first_ != &call) return;
    (call.previous ? call.previous->next : first_) = call.next;
    (call.next ? call.next->previous : last_) = call.previous;
    call.previous = call.next = nullptr;
    --size_;
}

pending_calls::~pending_calls() {
    for (auto& call : all_)
        if (call->waiter) abandon(*call);
}

[[gnu::hot]] pending_call& pending_calls::open(call_owner& owner, call_waiter& waiter) {
    if (free_.empty()) {
        if (free_.capacity() <= all_.size()) free_.reserve(2 * all_.size() + 1); // `end` needs no memory
        all_.push_back(std::make_unique<pending_call>(*this));
        free_.push_back(all_.back().get());
    }
    auto* call = free_.back();
    free_.pop_back();
    on_.enlist(*call);
    call->owner = &owner;
    call->waiter = &waiter;
    waiter.call_ = call;
    return *call;
}

void call_waiter::give_up() {
    if (call_) call_->desk.give_up(*call_, errc::cancelled);
}

[[gnu::hot]] void pending_calls::end(pending_call& call, const call_outcome& outcome) {
    if (!call.waiter) return; // dropped: the loop has ended
    auto& waiter = *std::exchange(call.waiter, nullptr);
    waiter.call_ = nullptr;
    on_.delist(call);
    call.alarm.disarm();
    auto* made_in = std::exchange(call.made_in, nullptr);
    if (outcome.why) failures.add(outcome.why->code());
    else ++answered;
    if (call.spans) [[unlikely]] {
        call.spans = false;
        on_span(call, outcome.why);
    }
    if (call.trace) [[unlikely]]
        call.trace = {};
    call.state = call_state::starting;
    call.holder = nullptr;
    call.owner = nullptr;
    if (call.waiting.size() > 0) call.waiting.clear();
    if (call.waiting.raw.capacity() > kept_capacity) call.waiting.raw = buffer();
    call.number = call.sent_to = 0;
    free_.push_back(&call);
    if (made_in && outcome.why && outcome.why->code() == errc::timed_out)
        return end_late(waiter, *made_in, *outcome.why);
    waiter.end(on_, outcome);
}

void pending_calls::end_late(call_waiter& waiter, const call_context& made_in, const failure& late) {
    failure why(errc::timed_out, late.message() + suspected_cycle(made_in), late.executed());
    call_outcome outcome;
    outcome.why = &why;
    waiter.end(on_, outcome);
}

void pending_calls::each_awaited(function_ref<void(const pending_call&)> visit) const {
    for (const auto& call : all_)
        if (call->waiter && call->made_in) visit(*call);
}

void pending_calls::fail(pending_call& call, const failure& why) {
    call_outcome outcome;
    outcome.why = &why;
    end(call, outcome);
}

void pending_calls::abandon(pending_call& call) {
    on_.delist(call);
    call.drop();
}

void pending_calls::give_up(pending_call& call, errc why) { fail(call, call.holder->let_go(call, why)); }

} // namespace ise
