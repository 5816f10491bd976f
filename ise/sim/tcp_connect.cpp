// The client's side of a virtual connection: asks again while the way is closed, until it is over.
#include <ise/sim/tcp_acceptor.hpp>
#include <ise/sim/tcp_connection.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

namespace ise::sim {
namespace {

struct outcome {
    std::error_code problem;
    std::unique_ptr<stream> connected;
};

class dial : public std::enable_shared_from_this<dial> {
public:
    dial(socket_owner& owner, loop& on, endpoint to, machine& target)
        : done(on), owner_(owner), loop_(on), where_(owner.flow_of(on)), to_(std::move(to)), target_(target),
          world_(owner.world()), net_(owner.net()), over_(net_.between(owner.here().name(), target.name())) {}

    void start() {
        port_ = to_.kind == protocol::tcp ? owner_.here().ephemeral_port() : std::uint16_t{0};
        name_ = fmt::format("{}:{}", owner_.here().name(), port_);
        world_.note("connect", name_ + "->" + to_.text());
        deadline_ = world_.engine().at(world_.now() + net_.connect_timeout, where_, [self = weak_from_this()] {
            if (auto still = self.lock()) still->finish({asio::error::timed_out, nullptr});
        });
        ask();
    }

    void give_up() {
        if (!std::exchange(over_now_, true)) world_.engine().cancel(deadline_);
    }

    waiter<outcome> done;

private:
    template <class F>
    void after(duration time, F what) {
        world_.engine().at(world_.now() + time, nullptr, [self = shared_from_this(), what] { what(*self); });
    }
    bool passes() { return net_.passes(owner_.here(), target_) && owner_.here().up(); }
    duration one_way() {
        const auto flight = net_.send(over_, owner_.here().name() <= target_.name(), 0);
        return flight.arrives - world_.now();
    }

    void ask() {
        if (over_now_ || !owner_.running()) return;
        if (!passes() || over_.random_loss()) return after(net_.connect_retry, [](dial& self) { self.ask(); });
        after(one_way(), [](dial& self) { self.arrive(); });
    }

    void arrive() {
        if (over_now_ || !owner_.running()) return;
        if (!passes()) return after(net_.connect_retry, [](dial& self) { self.ask(); });
        auto* acceptor = acceptor_for(target_, to_);
        if (!acceptor) {
            world_.note("refused", name_ + "->" + to_.text());
            return after(one_way(), [](dial& self) { self.refused(); });
        }
        if (acceptor->full()) return after(net_.connect_retry, [](dial& self) { self.ask(); });
        connection_ = std::make_shared<tcp_connection>(
            net_, owner_.here(), target_, name_,
            fmt::format("{}:{}", target_.name(), to_.kind == protocol::tcp ? std::to_string(to_.port) : to_.path));
        auto peer = to_;
        if (to_.kind == protocol::tcp) {
            const bool own = &target_ == &owner_.here();
            peer.host = own ? to_.host : owner_.here().address();
            peer.port = port_;
        }
        const auto back = one_way();
        connection_->not_before(1, world_.now() + back);
        auto accepted = connection_->open_side(1, acceptor->owner(), acceptor->on(), peer.text(), to_);
        after(back, [](dial& self) { self.answered(); });
        acceptor->push(std::move(accepted));
    }

    void refused() {
        if (!passes()) return after(net_.connect_retry, [](dial& self) { self.ask(); });
        finish_there({asio::error::connection_refused, nullptr});
    }

    void answered() {
        if (over_now_ || !owner_.running()) return connection_->reset_from(0);
        if (!passes()) return after(net_.connect_retry, [](dial& self) { self.answered(); });
        world_.note("connected", name_ + "->" + to_.text());
        auto made = connection_->open_side(0, owner_, loop_, to_.text());
        connection_->cut_if_at_start();
        finish_there({{}, std::move(made)});
    }

    // From the network's side: the result is handed over on the loop.
    void finish_there(outcome result) {
        submit(where_,
               [self = shared_from_this(), result = std::move(result)]() mutable { self->finish(std::move(result)); });
    }

    void finish(outcome result) {
        if (std::exchange(over_now_, true)) return; // what came too late closes itself
        world_.engine().cancel(deadline_);
        loop::turn in(loop_);
        done.resume(std::move(result));
    }

    socket_owner& owner_;
    loop& loop_;
    std::shared_ptr<flow> where_;
    endpoint to_;
    machine& target_;
    world_core& world_;
    network& net_;
    link& over_;
    std::string name_;
    std::uint16_t port_ = 0;
    std::shared_ptr<tcp_connection> connection_;
    scheduler::ticket deadline_;
    bool over_now_ = false;
};

} // namespace

task<result<std::unique_ptr<stream>>> connect_tcp(socket_owner& owner, loop& on, endpoint to) {
    auto& here = owner.here();
    auto* target = to.kind == protocol::local || here.is_me(to.host) ? &here : owner.net().find(to.host);
    if (!target)
        co_return failure(errc::unreachable,
                          fmt::format("cannot connect to {}: the virtual world has no host '{}'", to.text(), to.host));
    auto attempt = std::make_shared<dial>(owner, on, to, *target);
    attempt->start();
    auto came = co_await attempt->done.wait();
    if (came.connected) co_return std::move(came.connected);
    attempt->give_up();
    if (came.problem == asio::error::operation_aborted)
        co_return failure(errc::cancelled, fmt::format("connecting to {} was given up", to.text()));
    co_return failure(errc::unreachable, fmt::format("cannot connect to {}: {}", to.text(), came.problem.message()));
}

} // namespace ise::sim
