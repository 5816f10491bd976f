#include <ise/net/connect.hpp>

#include <ise/core/async_run.hpp>
#include <ise/core/task_scope.hpp>

#include <asio/bind_cancellation_slot.hpp>
#include <asio/cancellation_signal.hpp>

#include <fmt/format.h>

namespace ise::net {

task<result<std::unique_ptr<stream>>> connect_until(loop& on, endpoint to, time_point deadline, security with) {
    using outcome = result<std::unique_ptr<stream>>;
    // The attempt is a coroutine of its own, so that the deadline cancels it and not whoever asked.
    struct attempt {
        asio::cancellation_signal cancel;
        std::optional<outcome> got;
        std::exception_ptr thrown;
        bool abandoned = false;
    };
    auto state = std::make_shared<attempt>();
    auto where = to.text();
    waiter<> done(on);
    auto* wake = &done;
    auto body = [](std::shared_ptr<attempt> of, loop& at, endpoint target, security shown) -> task<> {
        auto got = co_await target.kind->connect(at, target, std::move(shown));
        of->got.emplace(std::move(got));
    };
    auto finished = [state, wake](std::exception_ptr thrown) {
        state->thrown = thrown;
        if (!state->abandoned) wake->resume();
    };
    bool late = false;
    timer alarm(on, [&] {
        late = true;
        state->cancel.emit(asio::cancellation_type::terminal);
        done.resume();
    });
    alarm.arm(deadline);
    struct leaving { // whichever way this coroutine ends, the attempt finds nobody waiting
        std::shared_ptr<attempt> of;
        ~leaving() { of->abandoned = true; }
    } guard{state};
    async_run(on.get_executor(), body(state, on, std::move(to), std::move(with)),
              asio::bind_cancellation_slot(state->cancel.slot(), std::move(finished)));
    if (!state->got && !state->thrown) co_await done.wait();
    if (state->got && *state->got) co_return std::move(*state->got);
    if (late) co_return failure(errc::timed_out, fmt::format("cannot connect to {}: no answer in time", where));
    if (state->got) co_return std::move(*state->got);
    state->cancel.emit(asio::cancellation_type::terminal);
    if (state->thrown)
        co_return failure(errc::unreachable, fmt::format("cannot connect to {}: {}", where, describe(state->thrown)));
    co_return failure(errc::cancelled, fmt::format("connecting to {} was cancelled", where));
}

task<result<std::unique_ptr<stream>>> connect_until(loop& on, endpoint to, time_point deadline) {
    return connect_until(on, std::move(to), deadline, security());
}

} // namespace ise::net
