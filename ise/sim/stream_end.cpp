#include <ise/sim/stream_end.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

namespace ise::sim {

stream_end::stream_end(socket_owner& owner, loop& on, std::size_t receive_limit_bytes, std::string peer,
                       std::optional<endpoint> local)
    : readable(on), writable_again(on), owner_(owner), where_(owner.flow_of(on)), loop_(on),
      received_(receive_limit_bytes), peer_(std::move(peer)), local_(std::move(local)) {}

transfer stream_end::read(std::span<std::byte> into) {
    if (closed_) return {asio::error::operation_aborted, 0};
    if (into.empty()) return {};
    if (!received_.empty()) {
        const auto count = received_.pop(into);
        drained();
        return {{}, count};
    }
    if (broken_) return {broken_, 0};
    if (ended_) return {asio::error::eof, 0};
    return {asio::error::would_block, 0};
}

transfer stream_end::write(std::span<const asio::const_buffer> from) {
    if (closed_) return {asio::error::operation_aborted, 0};
    if (broken_) return {broken_, 0};
    if (shut_) return {asio::error::broken_pipe, 0};
    std::size_t wanted = 0, moved = 0;
    for (const auto& piece : from) {
        wanted += piece.size();
        const auto count = std::min(piece.size(), send_room());
        if (count == 0) continue;
        send({static_cast<const std::byte*>(piece.data()), count});
        moved += count;
        if (count < piece.size()) break;
    }
    if (moved == 0 && wanted > 0) return {asio::error::would_block, 0};
    return {{}, moved};
}

std::error_code stream_end::writable() const {
    if (closed_) return asio::error::operation_aborted;
    if (broken_) return broken_;
    if (shut_) return asio::error::broken_pipe;
    return send_room() > 0 ? std::error_code{} : make_error_code(asio::error::would_block);
}

void stream_end::shutdown() {
    if (closed_ || dead_ || broken_ || std::exchange(shut_, true)) return;
    finish();
}

void stream_end::close() {
    if (std::exchange(closed_, true)) return;
    if (!dead_ && !broken_) let_go();
    readable.resume({asio::error::operation_aborted, 0});
    writable_again.resume({asio::error::operation_aborted, 0});
}

std::size_t stream_end::receive(bytes_view content) {
    const auto count = received_.push(content);
    wake(readable);
    return count;
}

void stream_end::receive_end() {
    ended_ = true;
    wake(readable);
}

void stream_end::fail(std::error_code why) {
    if (broken_) return;
    broken_ = why;
    wake(readable);
    wake(writable_again);
}

void stream_end::wake_writer() { wake(writable_again); }

void stream_end::wake(waiter<transfer>& who) {
    if (!who.waiting()) return;
    submit(where_, [self = shared_from_this(), &who] {
        loop::turn in(self->loop_);
        who.resume({});
    });
}

void stream_end::end(ending how) {
    if (dead_ || closed_) return;
    dead_ = true;
    if (!broken_) lost(how);
}

namespace {

class sim_stream final : public stream {
public:
    explicit sim_stream(std::shared_ptr<stream_end> end) : end_(std::move(end)) {}
    ~sim_stream() override { end_->close(); }

    task<transfer> read_some(asio::mutable_buffer into) override { return read(end_, into); }

    transfer try_write(std::span<const asio::const_buffer> from) override {
        if (auto fault = end_->owner().begin_operation()) return {fault, 0};
        return end_->write(from);
    }

    task<std::error_code> wait_writable() override { return wait(end_); }
    void limit_unsent(std::size_t most) override { end_->limit_unsent(most); }
    void shutdown_write() override { end_->shutdown(); }
    void close() override { end_->close(); }
    std::string peer() const override { return end_->peer(); }
    std::optional<endpoint> local() const override { return end_->local(); }

private:
    static task<transfer> read(std::shared_ptr<stream_end> end, asio::mutable_buffer into) {
        if (auto fault = end->owner().begin_operation()) co_return transfer{fault, 0};
        for (;;) {
            auto taken = end->read({static_cast<std::byte*>(into.data()), into.size()});
            if (taken.problem != asio::error::would_block) co_return taken;
            auto woken = co_await end->readable.wait();
            if (woken.problem) co_return woken;
        }
    }

    static task<std::error_code> wait(std::shared_ptr<stream_end> end) {
        if (auto fault = end->owner().begin_operation()) co_return fault;
        for (;;) {
            auto problem = end->writable();
            if (problem != asio::error::would_block) co_return problem;
            auto woken = co_await end->writable_again.wait();
            if (woken.problem) co_return woken.problem;
        }
    }

    std::shared_ptr<stream_end> end_;
};

} // namespace

std::unique_ptr<stream> make_stream(std::shared_ptr<stream_end> end) {
    return std::make_unique<sim_stream>(std::move(end));
}

} // namespace ise::sim
