#include <ise/call/pending_call.hpp>

#include <string>
#include <utility>

namespace ise {
namespace {

// A record that is used again keeps no more room for a request than this.
constexpr std::size_t kept_capacity = 4096;

} // namespace

void let_go_of_owner::operator()(call_owner* held) const noexcept {
    if (--held->calls_ == 0) auto last = std::move(held->self_); // may be the last of all
}

pending_call::pending_call(pending_calls& of)
    : desk(of), alarm(of.on(), [this] { desk.give_up(*this, errc::timed_out); }) {}

void pending_call::drop() noexcept {
    alarm.disarm();
    desk.unbind(*this);
    auto dropped = std::move(done);
}

pending_calls::~pending_calls() {
    for (auto& call : all_)
        if (call->done) on_.delist(*call);
}

pending_call& pending_calls::open(held_owner owner, call_cancellation& by) {
    if (free_.empty()) {
        all_.push_back(std::make_unique<pending_call>(*this));
        free_.push_back(all_.back().get());
    }
    auto* call = free_.back();
    free_.pop_back();
    on_.enlist(*call);
    call->owner = std::move(owner);
    call->cancellation = &by;
    by.call_ = call;
    return *call;
}

void pending_calls::unbind(pending_call& call) noexcept {
    if (auto* by = std::exchange(call.cancellation, nullptr)) by->call_ = nullptr;
}

call_cancellation::~call_cancellation() {
    if (call_) call_->cancellation = nullptr;
}

void call_cancellation::cancel() {
    if (call_) call_->desk.give_up(*call_, errc::cancelled);
}

void pending_calls::end(pending_call& call, const call_outcome& outcome) {
    if (!call.done) return; // dropped: the loop has ended
    on_.delist(call);
    call.alarm.disarm();
    unbind(call);
    auto done = std::move(call.done);
    auto* made_in = std::exchange(call.made_in, nullptr);
    if (outcome.why) failures.add(outcome.why->code());
    else ++answered;
    if (call.spans) [[unlikely]] {
        call.spans = false;
        on_span(call, outcome.why);
    }
    auto owner = std::move(call.owner); // lives until the completion has run
    call.state = call_state::starting;
    call.holder = nullptr;
    call.waiting.clear();
    if (call.waiting.raw.capacity() > kept_capacity) call.waiting.raw = buffer();
    call.number = call.sent_to = 0;
    free_.push_back(&call);
    if (auto cycle = made_in && outcome.why && outcome.why->code() == errc::timed_out ? suspected_cycle(*made_in)
                                                                                      : std::string();
        !cycle.empty()) {
        failure why(errc::timed_out, outcome.why->message() + cycle, outcome.why->executed());
        call_outcome result;
        result.why = &why;
        on_.later(done(result));
        return;
    }
    on_.later(done(outcome));
}

void pending_calls::each_awaited(function_ref<void(const pending_call&)> visit) const {
    for (const auto& call : all_)
        if (call->done && call->made_in) visit(*call);
}

void pending_calls::fail(pending_call& call, const failure& why) {
    call_outcome outcome;
    outcome.why = &why;
    end(call, outcome);
}

void pending_calls::abandon(pending_call& call) {
    unbind(call);
    on_.delist(call);
    auto dropped = std::move(call.done);
    auto owner = std::move(call.owner);
}

void pending_calls::give_up(pending_call& call, errc why) { fail(call, call.holder->let_go(call, why)); }

} // namespace ise
