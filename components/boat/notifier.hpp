#pragma once
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>

#include <list>
#include <system_error>

namespace atirma {

/// Coroutines of one loop wait here until something has changed; then each looks for itself whether it was that.
class notifier {
public:
    explicit notifier(ise::loop& on) : loop_(on) {}

    /// Completes when the notifier is rung, or at `until`. Cancellation: terminal, throws operation_aborted.
    ise::task<> wait(ise::time_point until) {
        waiting here(loop_);
        struct listed {
            std::list<waiting*>& in;
            std::list<waiting*>::iterator at;
            ~listed() { in.erase(at); }
        } guard{waiting_, waiting_.insert(waiting_.end(), &here)};
        if (until != ise::time_point::max()) here.late.arm(until);
        co_await here.wake.wait();
    }

    void notify() {
        for (auto* one : waiting_) one->wake.resume({});
    }

private:
    struct waiting {
        explicit waiting(ise::loop& on) : wake(on), late(on, [this] { wake.resume({}); }) {}
        ise::waiter<std::error_code> wake;
        ise::timer late;
    };

    ise::loop& loop_;
    std::list<waiting*> waiting_;
};

} // namespace atirma
