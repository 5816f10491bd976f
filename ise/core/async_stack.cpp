#include <ise/core/async_stack.hpp>

#include <asio/error.hpp>

#include <system_error>

namespace ise {

std::error_code detail::operation_aborted() noexcept { return asio::error::operation_aborted; }

constinit thread_local detail::trace_place* detail::present_trace = nullptr;

[[gnu::hot]] void async_stack::go_on() {
    if (phase_ != phase::suspended) { // resumed by what suspends it, which has not returned yet
        phase_ = phase::goes_on;
        return;
    }
    auto* before = std::exchange(detail::present_trace, &trace_);
    do {
        phase_ = phase::runs;
        suspended_at_ = nullptr;
        top_.resume();
    } while (phase_ == phase::goes_on);
    detail::present_trace = before;
    if (phase_ == phase::dropped) on_drop();
    else if (!top_) on_end();
    else phase_ = phase::suspended;
}

void async_stack::drop() noexcept {
    if (phase_ == phase::suspended) on_drop();
    else phase_ = phase::dropped;
}

void async_stack::cancel() {
    if (!accepts_cancellation_) return;
    cancelled_ = true;
    if (suspended_at_) suspended_at_->cancel();
}

void async_stack::throw_again(const std::exception_ptr& what) { std::rethrow_exception(what); }

void async_stack::throw_cancelled() { throw std::system_error(asio::error::operation_aborted, "co_await"); }

} // namespace ise
