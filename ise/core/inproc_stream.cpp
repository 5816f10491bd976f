#include <ise/core/inproc_stream.hpp>

#include <ise/core/object_stream.hpp>
#include <ise/core/waiter.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <algorithm>
#include <cstring>
#include <mutex>

namespace ise {
namespace {

class side;

// One direction. The two sides meet here and nowhere else; each wakes the other, at most once for each time that the
// other said that it waits: through the gate of its loop, or, on the same loop, in the present turn. There no lock is
// needed.
class channel {
public:
    explicit channel(std::size_t capacity) : capacity_(capacity) {}

    void join(const std::shared_ptr<side>& reader, const std::shared_ptr<side>& writer);
    bool on_one_loop() const noexcept { return one_loop_; }

    // For the reader. `would_block`: nothing yet, and the reader will be woken.
    transfer read(std::span<std::byte> into);
    std::error_code take(buffer& content, ring<passed_object>& attachments); // all of it, into what is empty
    bool wait();                                                             // false: there is more, or the end
    void refuse();                                                           // nobody will read any more

    // For the writer. `would_block`: full.
    transfer write(std::span<const asio::const_buffer> from);
    transfer pass(buffer& from, ring<passed_object>& attachments);
    std::error_code writable(); // `would_block`: no, and the writer will be woken
    void end();                 // nothing more will be written

private:
    std::unique_lock<std::mutex> hold() {
        return one_loop_ ? std::unique_lock<std::mutex>() : std::unique_lock(mutex_);
    }
    std::size_t weight() const noexcept { return content_.size() - begin_ + attached_weight_; }
    void drop_content() noexcept;
    void wake_reader(std::unique_lock<std::mutex> held);
    void post_to_reader();
    void wake_writer(std::unique_lock<std::mutex> held);

    std::mutex mutex_;
    const std::size_t capacity_;
    buffer content_;
    std::size_t begin_ = 0; // what lies before was read
    ring<passed_object> attachments_;
    std::size_t attached_weight_ = 0;
    bool one_loop_ = false;
    bool ended_ = false;
    bool refused_ = false;
    bool reader_waits_ = false;
    bool writer_waits_ = false;
    std::weak_ptr<side> reader_, writer_;
    side *near_reader_ = nullptr, *near_writer_ = nullptr; // on one loop: who waits is there
    std::shared_ptr<loop_gate> reader_gate_, writer_gate_;
};

// What a stream's coroutines hold on to: the stream itself may be destroyed under them.
class side final : public std::enable_shared_from_this<side>, public flushable {
public:
    side(loop& owner, std::shared_ptr<channel> in, std::shared_ptr<channel> out)
        : incoming(std::move(in)), outgoing(std::move(out)), on(owner), gate(owner.gate()), readable(owner),
          writable(owner) {}

    void close() {
        if (std::exchange(closed, true)) return;
        outgoing->end();
        incoming->refuse();
        readable.resume({asio::error::operation_aborted, 0});
        writable.resume({asio::error::operation_aborted, 0});
    }

    // Something has come, or the end. In a turn, and not from within the writer: it may be in the middle of anything.
    void wake() {
        if (receiver) on.flush_soon(*this);
        else readable.resume({});
    }
    void flush() override {
        if (closed) return;
        if (auto problem = incoming->take(content, attachments)) {
            if (problem == asio::error::would_block) return;
            over = true;
            return readable.resume({problem, 0});
        }
        receiver->on_passed(content, attachments);
        content.recycle();
        if (!attachments.empty()) attachments.clear();
        if (!incoming->wait()) on.flush_soon(*this); // others have their turn before
    }

    const std::shared_ptr<channel> incoming, outgoing;
    loop& on;
    const std::shared_ptr<loop_gate> gate;
    waiter<transfer> readable, writable;
    bool closed = false;
    bool over = false;                       // the receiver was given everything
    object_stream::user* receiver = nullptr; // of all that comes
    buffer content;                          // while it is being handed over
    ring<passed_object> attachments;
};

void channel::join(const std::shared_ptr<side>& reader, const std::shared_ptr<side>& writer) {
    reader_ = reader;
    writer_ = writer;
    near_reader_ = reader.get();
    near_writer_ = writer.get();
    reader_gate_ = reader->gate;
    writer_gate_ = writer->gate;
    one_loop_ = reader_gate_ == writer_gate_;
}

void channel::wake_reader(std::unique_lock<std::mutex> held) {
    if (!std::exchange(reader_waits_, false)) return;
    if (held) held.unlock();
    if (one_loop_) near_reader_->wake();
    else post_to_reader();
}

void channel::post_to_reader() {
    reader_gate_->post([weak = reader_] {
        if (auto reader = weak.lock()) reader->wake();
    });
}

void channel::wake_writer(std::unique_lock<std::mutex> held) {
    if (!std::exchange(writer_waits_, false)) return;
    if (held) held.unlock();
    if (one_loop_) return near_writer_->writable.resume({});
    writer_gate_->post([weak = writer_] {
        if (auto writer = weak.lock()) writer->writable.resume({});
    });
}

void channel::drop_content() noexcept {
    content_.clear();
    begin_ = 0;
}

transfer channel::read(std::span<std::byte> into) {
    auto held = hold();
    const auto count = std::min(into.size(), content_.size() - begin_);
    if (count == 0) {
        if (ended_) return {asio::error::eof, 0};
        reader_waits_ = true;
        return {asio::error::would_block, 0};
    }
    std::memcpy(into.data(), content_.data() + begin_, count);
    begin_ += count;
    if (begin_ == content_.size()) {
        drop_content();
    } else if (begin_ > content_.size() / 2) {
        content_.drop_front(begin_);
        begin_ = 0;
    }
    // A writer that waits is woken for a good piece of room, not for each byte.
    if (weight() <= capacity_ - capacity_ / 4) wake_writer(std::move(held));
    return {{}, count};
}

std::error_code channel::take(buffer& content, ring<passed_object>& attachments) {
    auto held = hold();
    if (content_.empty()) {
        if (ended_) return asio::error::eof;
        reader_waits_ = true;
        return asio::error::would_block;
    }
    if (begin_ > 0) content_.drop_front(std::exchange(begin_, 0));
    content = std::move(content_); // they change places
    if (!attachments_.empty()) std::swap(attachments, attachments_);
    attached_weight_ = 0;
    wake_writer(std::move(held));
    return {};
}

bool channel::wait() {
    auto held = hold();
    reader_waits_ = content_.empty() && !ended_;
    return reader_waits_;
}

void channel::refuse() {
    ring<passed_object> dropped; // outside of the lock
    std::unique_lock held(mutex_);
    refused_ = true;
    drop_content();
    std::swap(dropped, attachments_);
    attached_weight_ = 0;
    reader_waits_ = false;
    wake_writer(std::move(held));
}

transfer channel::write(std::span<const asio::const_buffer> from) {
    auto held = hold();
    if (refused_ || ended_) return {asio::error::broken_pipe, 0};
    const auto before = content_.size();
    std::size_t wanted = 0;
    for (const auto& piece : from) {
        wanted += piece.size();
        const auto room = capacity_ - std::min(capacity_, weight());
        content_.append({static_cast<const std::byte*>(piece.data()), std::min(piece.size(), room)});
    }
    const auto moved = content_.size() - before;
    if (moved == 0) return {wanted > 0 ? make_error_code(asio::error::would_block) : std::error_code{}, 0};
    wake_reader(std::move(held));
    return {{}, moved};
}

transfer channel::pass(buffer& from, ring<passed_object>& attachments) {
    auto held = hold();
    if (refused_ || ended_) return {asio::error::broken_pipe, 0};
    if (weight() >= capacity_) return {asio::error::would_block, 0};
    const auto moved = from.size();
    if (content_.empty()) content_ = std::move(from); // they change places
    else content_.append(from.view());
    from.recycle();
    if (!attachments.empty()) {
        for (std::size_t place = 0; place < attachments.size(); ++place)
            attached_weight_ += attachments[place].weight();
        if (attachments_.empty()) std::swap(attachments, attachments_);
        while (!attachments.empty()) attachments_.push_back(attachments.pop_front());
    }
    wake_reader(std::move(held));
    return {{}, moved};
}

std::error_code channel::writable() {
    auto held = hold();
    if (refused_ || ended_) return asio::error::broken_pipe;
    if (weight() < capacity_) return {};
    writer_waits_ = true;
    return asio::error::would_block;
}

void channel::end() {
    std::unique_lock held(mutex_);
    ended_ = true;
    writer_waits_ = false;
    if (!std::exchange(reader_waits_, false)) return;
    held.unlock();
    post_to_reader(); // its loop may be gone: the gate knows
}

class inproc_stream final : public object_stream {
public:
    inproc_stream(std::shared_ptr<side> state, std::string peer) : side_(std::move(state)), peer_(std::move(peer)) {}
    ~inproc_stream() override { side_->close(); }

    task<transfer> read_some(asio::mutable_buffer into) override { return read(side_, into); }

    transfer try_write(std::span<const asio::const_buffer> from) override {
        if (side_->closed) return {asio::error::operation_aborted, 0};
        return side_->outgoing->write(from);
    }

    void use(user& receiver) override {
        side_->receiver = &receiver;
        side_->wake();
    }
    transfer pass(buffer& content, ring<passed_object>& attachments) override {
        if (side_->closed) return {asio::error::operation_aborted, 0};
        return side_->outgoing->pass(content, attachments);
    }
    bool on_one_loop() const noexcept override { return side_->outgoing->on_one_loop(); }

    task<std::error_code> wait_writable() override { return wait(side_); }

    void shutdown_write() override { side_->outgoing->end(); }
    void close() override { side_->close(); }
    std::string peer() const override { return peer_; }

private:
    static task<transfer> read(std::shared_ptr<side> state, asio::mutable_buffer into) {
        const std::span<std::byte> room(static_cast<std::byte*>(into.data()), into.size());
        for (;;) {
            if (state->closed) co_return transfer{asio::error::operation_aborted, 0};
            if (state->over) co_return transfer{asio::error::eof, 0};
            if (room.empty()) co_return transfer{};
            if (!state->receiver) {
                auto taken = state->incoming->read(room);
                if (taken.problem != asio::error::would_block) co_return taken;
            }
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
