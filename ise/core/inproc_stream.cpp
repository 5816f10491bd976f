#include <ise/core/inproc_stream.hpp>

#include <ise/core/byte_queue.hpp>
#include <ise/core/waiter.hpp>

#include <asio/error.hpp>

#include <mutex>

namespace ise {
namespace {

class side;

// One direction. The two sides meet here and nowhere else; each wakes the other through the gate of its loop,
// at most once for each time that the other said that it waits.
class channel {
public:
    explicit channel(std::size_t capacity) : content_(capacity) {}

    void join(const std::shared_ptr<side>& reader, const std::shared_ptr<side>& writer);

    // For the reader. `would_block`: nothing yet, and the reader will be woken.
    transfer read(std::span<std::byte> into);
    void refuse(); // nobody will read any more

    // For the writer. `would_block`: full.
    transfer write(std::span<const asio::const_buffer> from);
    std::error_code writable(); // `would_block`: no, and the writer will be woken
    void end();                 // nothing more will be written

private:
    void wake_reader(std::unique_lock<std::mutex> held);
    void wake_writer(std::unique_lock<std::mutex> held);

    std::mutex mutex_;
    byte_queue content_;
    bool ended_ = false;
    bool refused_ = false;
    bool reader_waits_ = false;
    bool writer_waits_ = false;
    std::weak_ptr<side> reader_, writer_;
    std::shared_ptr<loop_gate> reader_gate_, writer_gate_;
};

// What a stream's coroutines hold on to: the stream itself may be destroyed under them.
class side {
public:
    side(loop& owner, std::shared_ptr<channel> in, std::shared_ptr<channel> out)
        : gate_(owner.gate()), incoming(std::move(in)), outgoing(std::move(out)),
          readable(owner, [this] { readable.resume({asio::error::operation_aborted, 0}); }),
          writable(owner, [this] { writable.resume({asio::error::operation_aborted, 0}); }) {}

    void close() {
        if (std::exchange(closed, true)) return;
        outgoing->end();
        incoming->refuse();
        readable.resume({asio::error::operation_aborted, 0});
        writable.resume({asio::error::operation_aborted, 0});
    }

private:
    std::shared_ptr<loop_gate> gate_;

public:
    const std::shared_ptr<loop_gate>& gate() const noexcept { return gate_; }

    bool closed = false;
    std::shared_ptr<channel> incoming, outgoing;
    waiter<transfer> readable, writable;
};

void channel::join(const std::shared_ptr<side>& reader, const std::shared_ptr<side>& writer) {
    reader_ = reader;
    writer_ = writer;
    reader_gate_ = reader->gate();
    writer_gate_ = writer->gate();
}

void channel::wake_reader(std::unique_lock<std::mutex> held) {
    if (!std::exchange(reader_waits_, false)) return;
    held.unlock();
    if (reader_gate_ == writer_gate_) { // the waker is on the same loop
        if (auto reader = reader_.lock()) reader->readable.resume({});
        return;
    }
    reader_gate_->post([weak = reader_] {
        if (auto reader = weak.lock()) reader->readable.resume({});
    });
}

void channel::wake_writer(std::unique_lock<std::mutex> held) {
    if (!std::exchange(writer_waits_, false)) return;
    held.unlock();
    if (reader_gate_ == writer_gate_) {
        if (auto writer = writer_.lock()) writer->writable.resume({});
        return;
    }
    writer_gate_->post([weak = writer_] {
        if (auto writer = weak.lock()) writer->writable.resume({});
    });
}

transfer channel::read(std::span<std::byte> into) {
    std::unique_lock held(mutex_);
    if (content_.empty()) {
        if (ended_) return {asio::error::eof, 0};
        reader_waits_ = true;
        return {asio::error::would_block, 0};
    }
    const auto count = content_.pop(into);
    // A writer that waits is woken for a good piece of room, not for each byte.
    if (content_.room() >= content_.limit() / 4) wake_writer(std::move(held));
    return {{}, count};
}

void channel::refuse() {
    std::unique_lock held(mutex_);
    refused_ = true;
    content_.clear();
    reader_waits_ = false;
    wake_writer(std::move(held));
}

transfer channel::write(std::span<const asio::const_buffer> from) {
    std::unique_lock held(mutex_);
    if (refused_ || ended_) return {asio::error::broken_pipe, 0};
    std::size_t wanted = 0, moved = 0;
    for (const auto& piece : from) {
        wanted += piece.size();
        moved += content_.push({static_cast<const std::byte*>(piece.data()), piece.size()});
    }
    if (moved == 0) return {wanted > 0 ? make_error_code(asio::error::would_block) : std::error_code{}, 0};
    wake_reader(std::move(held));
    return {{}, moved};
}

std::error_code channel::writable() {
    std::lock_guard held(mutex_);
    if (refused_ || ended_) return asio::error::broken_pipe;
    if (content_.room() > 0) return {};
    writer_waits_ = true;
    return asio::error::would_block;
}

void channel::end() {
    std::unique_lock held(mutex_);
    ended_ = true;
    writer_waits_ = false;
    wake_reader(std::move(held));
}

class inproc_stream final : public stream {
public:
    inproc_stream(std::shared_ptr<side> state, std::string peer) : side_(std::move(state)), peer_(std::move(peer)) {}
    ~inproc_stream() override { side_->close(); }

    task<transfer> read_some(asio::mutable_buffer into) override { return read(side_, into); }

    transfer try_write(std::span<const asio::const_buffer> from) override {
        if (side_->closed) return {asio::error::operation_aborted, 0};
        return side_->outgoing->write(from);
    }

    task<std::error_code> wait_writable() override { return wait(side_); }

    void shutdown_write() override { side_->outgoing->end(); }
    void close() override { side_->close(); }
    std::string peer() const override { return peer_; }

private:
    static task<transfer> read(std::shared_ptr<side> state, asio::mutable_buffer into) {
        const std::span<std::byte> room(static_cast<std::byte*>(into.data()), into.size());
        for (;;) {
            if (state->closed) co_return transfer{asio::error::operation_aborted, 0};
            if (room.empty()) co_return transfer{};
            auto taken = state->incoming->read(room);
            if (taken.problem != asio::error::would_block) co_return taken;
            auto woken = co_await state->readable.wait();
            if (woken.problem) co_return woken;
        }
    }

    static task<std::error_code> wait(std::shared_ptr<side> state) {
        for (;;) {
            if (state->closed) co_return asio::error::operation_aborted;
            auto problem = state->outgoing->writable();
            if (problem != asio::error::would_block) co_return problem;
            auto woken = co_await state->writable.wait();
            if (woken.problem) co_return woken.problem;
        }
    }

    std::shared_ptr<side> side_;
    std::string peer_;
};

} // namespace

std::pair<std::unique_ptr<stream>, std::unique_ptr<stream>> make_inproc_pair(loop& near, loop& far, std::string name,
                                                                             std::size_t capacity_bytes) {
    auto there = std::make_shared<channel>(capacity_bytes);
    auto back = std::make_shared<channel>(capacity_bytes);
    auto first = std::make_shared<side>(near, back, there);
    auto second = std::make_shared<side>(far, there, back);
    there->join(second, first);
    back->join(first, second);
    return {std::make_unique<inproc_stream>(std::move(first), name),
            std::make_unique<inproc_stream>(std::move(second), name)};
}

} // namespace ise
