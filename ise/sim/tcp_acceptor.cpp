#include <ise/sim/tcp_acceptor.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

namespace ise::sim {

tcp_acceptor::tcp_acceptor(socket_owner& owner, loop& on, endpoint at)
    : incoming(on), owner_(owner), where_(owner.flow_of(on)), loop_(on), at_(std::move(at)) {
    owner_.here().acceptors.push_back(this);
}

tcp_acceptor::~tcp_acceptor() { leave(); }

void tcp_acceptor::leave() { std::erase(owner_.here().acceptors, this); }

void tcp_acceptor::push(std::unique_ptr<stream> connected) {
    backlog_.push_back(std::move(connected));
    if (!incoming.waiting()) return;
    submit(where_, [self = shared_from_this()] {
        loop::turn in(self->loop_);
        self->incoming.resume({});
    });
}

std::pair<std::error_code, std::unique_ptr<stream>> tcp_acceptor::take() {
    if (closed_) return {asio::error::operation_aborted, nullptr};
    if (backlog_.empty()) return {asio::error::would_block, nullptr};
    auto first = std::move(backlog_.front());
    backlog_.pop_front();
    return {std::error_code{}, std::move(first)};
}

void tcp_acceptor::close() {
    if (std::exchange(closed_, true)) return;
    leave();
    backlog_.clear();
    incoming.resume({asio::error::operation_aborted});
}

void tcp_acceptor::end(ending) { leave(); }

namespace {

class tcp_listener final : public listener {
public:
    using accepted = std::pair<std::error_code, std::unique_ptr<stream>>;

    explicit tcp_listener(std::shared_ptr<tcp_acceptor> acceptor) : acceptor_(std::move(acceptor)) {}
    ~tcp_listener() override { acceptor_->close(); }

    task<accepted> accept() override { return next(acceptor_); }
    void close() override { acceptor_->close(); }
    endpoint where() const override { return acceptor_->at(); }

private:
    static task<accepted> next(std::shared_ptr<tcp_acceptor> acceptor) {
        if (auto fault = acceptor->owner().begin_operation()) {
            accepted failed{fault, nullptr};
            co_return failed;
        }
        for (;;) {
            auto taken = acceptor->take();
            if (taken.first != asio::error::would_block) co_return taken;
            auto woken = co_await acceptor->incoming.wait();
            if (woken.problem) {
                accepted ended{woken.problem, nullptr};
                co_return ended;
            }
        }
    }

    std::shared_ptr<tcp_acceptor> acceptor_;
};

} // namespace

tcp_acceptor* acceptor_for(const machine& there, const endpoint& to) {
    for (auto* each : there.acceptors) {
        const auto& at = each->at();
        if (at.kind == to.kind && (at.kind == protocol::local ? at.path == to.path : there.hears(at, to))) return each;
    }
    return nullptr;
}

result<std::unique_ptr<listener>> listen_tcp(socket_owner& owner, loop& on, const endpoint& wanted) {
    std::vector<endpoint> taken;
    for (auto* each : owner.here().acceptors) taken.push_back(each->at());
    endpoint at;
    auto claimed = owner.here().claim(at, wanted, taken);
    if (!claimed) return claimed.error();
    auto acceptor = std::make_shared<tcp_acceptor>(owner, on, at);
    owner.attach(acceptor);
    owner.world().note("listen", owner.here().name() + " " + at.text());
    return std::unique_ptr<listener>(std::make_unique<tcp_listener>(std::move(acceptor)));
}

} // namespace ise::sim
