#include <ise/sim/datagram_end.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

namespace ise::sim {

datagram_end::datagram_end(socket_owner& owner, loop& on, endpoint at)
    : incoming(on), owner_(owner), where_(owner.flow_of(on)), loop_(on), at_(std::move(at)) {
    owner_.here().datagrams.push_back(this);
}

datagram_end::~datagram_end() { leave(); }

void datagram_end::leave() { std::erase(owner_.here().datagrams, this); }

std::pair<std::error_code, const datagram*> datagram_end::take() {
    if (closed_) return {asio::error::operation_aborted, nullptr};
    if (received_.empty()) return {asio::error::would_block, nullptr};
    taken_ = std::move(received_.front());
    received_.pop_front();
    received_bytes_ -= taken_.content.size();
    return {std::error_code{}, &taken_};
}

std::error_code datagram_end::send(const endpoint& to, bytes_view content) {
    if (closed_) return asio::error::operation_aborted;
    if (!owner_.running()) return asio::error::network_down;
    auto& here = owner_.here();
    auto& world = owner_.world();
    auto& net = owner_.net();
    auto* target = here.is_me(to.host) ? &here : net.find(to.host);
    if (!target || to.kind != protocol::udp) return asio::error::host_not_found;
    auto& over = net.between(here.name(), target->name());
    if (content.size() > over.datagram_limit_bytes) return asio::error::message_size;

    auto from = at_;
    from.host = target == &here ? (at_.host == "0.0.0.0" ? "127.0.0.1" : at_.host) : here.address();
    const auto name = fmt::format("{}:{}->{}:{}", here.name(), at_.port, target->name(), to.port);
    const int copies = over.random_duplicate() ? 2 : 1;
    if (copies == 2) world.note("duplicate", name, content.size());
    for (int copy = 0; copy < copies; ++copy) {
        const bool upward = here.name() <= target->name();
        // What finds the queue full takes no bandwidth; what is lost on the way does.
        if (net.queue(over, upward) > over.datagram_queue) {
            world.note("drop", name, content.size());
            continue;
        }
        const bool lost = over.random_loss();
        auto flight = net.send(over, upward, content.size());
        flight.arrives += over.random_reordering();
        if (lost || !net.passes(here, *target)) {
            world.note("drop", name, content.size());
            continue;
        }
        datagram made{from, bytes(content.begin(), content.end())};
        world.engine().at(flight.arrives, nullptr,
                          [&world, &net, &here, target, to, name, made = std::move(made)]() mutable {
                              auto* there = net.passes(here, *target) ? datagram_for(*target, to) : nullptr;
                              world.note(there ? "datagram" : "drop", name, made.content.size());
                              if (there) there->arrive(std::move(made));
                          });
    }
    return {};
}

void datagram_end::arrive(datagram what) {
    if (received_bytes_ + what.content.size() > receive_limit_bytes) {
        owner_.world().note("drop", owner_.here().name() + " receive buffer", what.content.size());
        return;
    }
    received_bytes_ += what.content.size();
    received_.push_back(std::move(what));
    if (reader_ || incoming.waiting()) announce();
}

void datagram_end::announce() {
    submit(where_, [self = shared_from_this()] {
        loop::turn in(self->loop_);
        if (self->reader_) self->deliver();
        else self->incoming.resume({});
    });
}

void datagram_end::deliver_to(datagram_reader& reader, std::size_t max_bytes) {
    reader_ = &reader;
    max_bytes_ = max_bytes;
    if (!received_.empty()) announce();
}

void datagram_end::deliver() {
    while (!closed_ && !received_.empty()) {
        if (auto fault = owner_.begin_operation()) {
            announce(); // it stays until the next time
            return reader_->on_problem(fault);
        }
        take();
        if (taken_.content.size() <= max_bytes_) reader_->on_datagram(taken_.peer, taken_.content);
    }
}

void datagram_end::close() {
    if (std::exchange(closed_, true)) return;
    leave();
    incoming.resume({asio::error::operation_aborted});
}

void datagram_end::end(ending) { leave(); }

namespace {

class udp_socket final : public datagram_socket {
public:
    using received = std::pair<std::error_code, const datagram*>;

    explicit udp_socket(std::shared_ptr<datagram_end> end) : end_(std::move(end)) {}
    ~udp_socket() override { end_->close(); }

    void deliver_to(datagram_reader& reader, std::size_t max_bytes) override { end_->deliver_to(reader, max_bytes); }
    task<received> receive() override { return next(end_); }
    std::error_code try_send(const endpoint& to, bytes_view content) override {
        if (auto fault = end_->owner().begin_operation()) return fault;
        return end_->send(to, content);
    }
    void close() override { end_->close(); }
    endpoint where() const override { return end_->at(); }

private:
    static task<received> next(std::shared_ptr<datagram_end> end) {
        if (auto fault = end->owner().begin_operation()) {
            received failed{fault, nullptr};
            co_return failed;
        }
        for (;;) {
            auto taken = end->take();
            if (taken.first != asio::error::would_block) co_return taken;
            auto woken = co_await end->incoming.wait();
            if (woken.problem) {
                received ended{woken.problem, nullptr};
                co_return ended;
            }
        }
    }

    std::shared_ptr<datagram_end> end_;
};

} // namespace

datagram_end* datagram_for(const machine& there, const endpoint& to) {
    for (auto* each : there.datagrams)
        if (there.hears(each->at(), to)) return each;
    return nullptr;
}

result<std::unique_ptr<datagram_socket>> open_udp(socket_owner& owner, loop& on, const endpoint& wanted) {
    std::vector<endpoint> taken;
    for (auto* each : owner.here().datagrams) taken.push_back(each->at());
    endpoint at;
    auto claimed = owner.here().claim(at, wanted, taken);
    if (!claimed) return claimed.error();
    auto end = std::make_shared<datagram_end>(owner, on, at);
    owner.attach(end);
    return std::unique_ptr<datagram_socket>(std::make_unique<udp_socket>(std::move(end)));
}

} // namespace ise::sim
