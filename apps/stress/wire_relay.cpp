#include "wire_relay.hpp"

#include <ise/net/bounded_acceptor.hpp>

#include <asio/error.hpp>

namespace atirma::stress {
namespace {

constexpr ise::duration pause = std::chrono::milliseconds(100); // after what could not be accepted or received

} // namespace

ise::task<> wire_relay::run() {
    auto door = env().listen(on(), ise::endpoint::parse(listen_).value());
    auto at = std::move(door.value());
    if (on_listening_) on_listening_(at->where());
    auto take = [this](ise::net::admitted who) {
        auto made = std::make_shared<wire>();
        made->near = std::move(who.line);
        made->by = make_();
        spawn("line", connect(std::move(made)));
    };
    auto accepting = ise::net::accept_each(on(), std::move(at), nullptr, ise::net::log_to(on(), log()), take);
    co_await std::move(accepting);
}

ise::task<> wire_relay::connect(std::shared_ptr<wire> what) {
    auto to = ise::endpoint::parse(onward_).value();
    auto opened = co_await env().connect(on(), to);
    if (!opened) {
        what->near->close();
        co_return;
    }
    what->far = std::move(*opened);
    auto carrying = carry(*this, what);
    co_await std::move(carrying);
}

struct datagram_wire::ends {
    ise::component& self;
    std::unique_ptr<ise::datagram_socket> near;
    std::shared_ptr<ise::datagram_socket> far; ///< one for each caller: who calls anew shall be seen to do so
    std::unique_ptr<tap> by;
    ise::endpoint onward;
    std::optional<ise::endpoint> caller;
};

ise::task<> datagram_wire::run() {
    auto onward = ise::endpoint::parse(onward_).value();
    auto between = std::make_shared<ends>(ends{*this, nullptr, nullptr, make_(), std::move(onward), {}});
    between->near = std::move(env().open_datagram(on(), ise::endpoint::parse(listen_).value()).value());
    if (on_listening_) on_listening_(between->near->where());
    const auto anywhere = ise::endpoint::parse("udp://0.0.0.0:0").value();
    for (;;) {
        auto [problem, got] = co_await between->near->receive();
        if (problem == asio::error::operation_aborted) co_return;
        if (problem) {
            co_await sleep(pause);
            continue;
        }
        if (between->caller != got->peer) {
            if (between->far) between->far->close();
            between->far = std::move(env().open_datagram(on(), anywhere).value());
            between->caller = got->peer;
            spawn("inward", inward(between, between->far));
        }
        between->by->wrote(got->content);
        between->far->try_send(between->onward, got->content); // or it is lost, as datagrams are
    }
}

ise::task<> datagram_wire::inward(std::shared_ptr<ends> between, std::shared_ptr<ise::datagram_socket> far) {
    for (;;) {
        auto [problem, got] = co_await far->receive();
        if (problem == asio::error::operation_aborted) co_return;
        if (problem) {
            co_await between->self.sleep(pause);
            continue;
        }
        between->by->read(got->content);
        between->near->try_send(*between->caller, got->content);
    }
}

} // namespace atirma::stress
