#include <ise/net/connect.hpp>

#include <ise/core/task_scope.hpp>
#include <ise/net/tls/transport.hpp>
#include <ise/net/udp/transport.hpp>

#include <asio/bind_cancellation_slot.hpp>
#include <asio/cancellation_signal.hpp>
#include <asio/co_spawn.hpp>
#include <asio/use_awaitable.hpp>

#include <fmt/format.h>

namespace ise::net {

namespace {

failure no_identity(const endpoint& at) {
    return {errc::invalid_argument, fmt::format("{} takes a certificate of this side: give the folder with ca.pem, "
                                                "certificate.pem and key.pem with --tls FOLDER or ISE_TLS",
                                                at.text())};
}

} // namespace

result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at, std::shared_ptr<tls::identity> with) {
    if (at.kind == protocol::udp) return udp::listen(on, at);
    if (at.kind != protocol::tls) return on.env().listen(on, at);
    if (!with) return no_identity(at);
    return tls::listen(on, at, std::move(with));
}

task<result<std::unique_ptr<stream>>> connect_until(loop& on, endpoint to, time_point deadline,
                                                    std::shared_ptr<tls::identity> with) {
    if (to.kind == protocol::tls && !with) co_return no_identity(to);
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
    waiter<> done(on, [&done] { done.resume(); });
    auto* wake = &done;
    auto body = [](std::shared_ptr<attempt> of, loop& at, endpoint target,
                   std::shared_ptr<tls::identity> shown) -> task<> {
        if (target.kind == protocol::udp) {
            auto got = co_await udp::connect(at, std::move(target));
            of->got.emplace(std::move(got));
        } else if (target.kind == protocol::tls) {
            auto got = co_await tls::connect(at, std::move(target), std::move(shown));
            of->got.emplace(std::move(got));
        } else {
            auto got = co_await at.env().connect(at, std::move(target));
            of->got.emplace(std::move(got));
        }
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
    asio::co_spawn(on.get_executor(), body(state, on, std::move(to), std::move(with)),
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

} // namespace ise::net
