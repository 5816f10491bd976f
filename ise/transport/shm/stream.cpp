#include <ise/transport/shm/stream.hpp>

#include <ise/core/real/system_sockets.hpp>
#include <ise/core/verified_peer.hpp>
#include <ise/core/waiter.hpp>
#include <ise/transport/shm/loaned.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <fmt/format.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <optional>
#include <utility>
#include <vector>

#include <unistd.h>

namespace ise::net::shm {
namespace {

enum class trouble { broken = 1 };

class trouble_category final : public std::error_category {
public:
    const char* name() const noexcept override { return "ise.shm"; }
    std::string message(int) const override { return "the peer broke the rings in shared memory"; }
};
std::error_code broken_rings() {
    static const trouble_category category;
    return {static_cast<int>(trouble::broken), category};
}

class shared_stream;

// Watched for reading as long as the stream is open.
class watched_descriptor : public real::descriptor {
public:
    std::error_code begin() {
        auto problem = watch();
        if (!problem) want_read();
        return problem;
    }
    void close() noexcept { close_descriptor(); }

protected:
    watched_descriptor(loop& on, owned_fd fd, shared_stream& of) noexcept : descriptor(on, std::move(fd)), of_(of) {}
    ~watched_descriptor() { close(); }

    shared_stream& of_;

private:
    void on_writable() override {}
};

// The local socket: after the agreement nothing comes over it but notices of blocks, and its end.
class lifeline final : public watched_descriptor {
public:
    lifeline(loop& on, owned_fd socket, shared_stream& of) noexcept : watched_descriptor(on, std::move(socket), of) {}

private:
    void on_readable() override;
    bool take_notices();
};

// Rung by the peer, for either ring.
class doorbell final : public watched_descriptor {
public:
    doorbell(loop& on, owned_fd bell, shared_stream& of) noexcept : watched_descriptor(on, std::move(bell), of) {}

private:
    void on_readable() override;
};

class shared_stream final : public stream, public verified_stream, public loans, private unannounced {
public:
    shared_stream(loop& on, ends over, std::string peer)
        : on_(on), memory_(std::make_shared<const mapping>(std::move(over.memory))), ring_(over.connecting ? 0 : 1),
          writer_(memory_->writer(ring_)), reader_(memory_->reader(1 - ring_)),
          borrower_(std::in_place, memory_, 1 - ring_), peer_bell_(std::move(over.peer_bell)), peer_(std::move(peer)),
          user_(user_of(over.socket.get())), socket_(on, std::move(over.socket), *this),
          own_bell_(on, std::move(over.own_bell), *this), bytes_(on), room_(on),
          look_again_(on, [this] { on_rung(); }) {}
    ~shared_stream() override { close(); }

    std::error_code begin() {
        auto problem = socket_.begin();
        return problem ? problem : own_bell_.begin();
    }

    task<transfer> read_some(asio::mutable_buffer into) override;
    bool deliver_to(stream_reader& reader) override;
    transfer try_write(std::span<const asio::const_buffer> from) override;
    task<std::error_code> wait_writable() override;
    void limit_unsent(std::size_t most) override { writer_.limit(most); }
    void shutdown_write() override;
    void close() override;
    std::string peer() const override { return peer_; }
    void add_verified(verified_peer& to) const override { to.user = user_; }

    large_memory_source* memory() noexcept override { return block_pool::of(on_).get(); }
    std::optional<loan_reference> loan(const shared_bytes& content) override;
    result<passed_object> borrow(const loan_reference& what) override { return borrower_->borrow(what); }

    void on_rung();
    void on_gone();
    bool on_notice(bytes_view notice, std::span<owned_fd> passed) { return borrower_->on_notice(notice, passed); }

private:
    struct outcome {
        std::error_code problem;
    };
    static constexpr int reads_in_a_row = 16;

    static std::optional<std::uint32_t> user_of(int socket) noexcept;
    bool is_read() const noexcept { return deliver_to_ || bytes_.waiting(); }
    transfer take();
    void deliver();
    std::error_code room();
    void ring() noexcept;
    bool look() override;
    void rest() override;

    loop& on_;
    std::shared_ptr<const mapping> memory_;
    int ring_; // the one that this side writes
    ring_writer writer_;
    ring_reader reader_;
    std::unique_ptr<lender> lender_;   // once something is loaned
    std::optional<borrower> borrower_; // while it is open
    owned_fd peer_bell_;
    std::string peer_;
    std::optional<std::uint32_t> user_;
    lifeline socket_;
    doorbell own_bell_;
    stream_reader* deliver_to_ = nullptr;
    asio::mutable_buffer into_; // of the read that waits
    waiter<transfer> bytes_;
    waiter<outcome> room_;
    timer look_again_; // without a bell, after others had their turn
    int reads_left_ = reads_in_a_row;
    bool closed_ = false;
    std::atomic<bool> gone_{false}; // the peer; signs of life look at it from another thread
};

void lifeline::on_readable() {
    if (take_notices()) want_read();
    else of_.on_gone();
}

// False: the end, or something that is no notice, which no peer that keeps to the agreement sends. If a peer sends more
// and more, the rest waits for another turn.
bool lifeline::take_notices() {
    for (std::size_t left = loan_slots; left > 0; --left) {
        std::array<std::byte, block_notice::bytes> notice;
        std::vector<owned_fd> passed;
        const auto got = real::receive_passed(fd(), asio::buffer(notice), passed);
        if (!got.problem && of_.on_notice(bytes_view(notice).first(got.bytes), passed)) continue;
        found_nothing();
        return got.problem == asio::error::would_block;
    }
    return true;
}

// Where each ring is told it need not be read.
void doorbell::on_readable() {
    std::uint64_t rings = 0;
    if (!told_each()) [[maybe_unused]]
        auto count = ::read(fd(), &rings, sizeof rings);
    found_nothing();
    want_read();
    of_.on_rung();
}

std::optional<std::uint32_t> shared_stream::user_of(int socket) noexcept { return real::user_of_peer(socket); }

// The coroutine touches nothing of the stream after it has waited: that may be gone by then.
task<transfer> shared_stream::read_some(asio::mutable_buffer into) {
    if (closed_) co_return transfer{asio::error::operation_aborted, 0};
    if (into.size() == 0) co_return transfer{};
    into_ = into;
    if (reads_left_-- > 0) {
        auto got = take();
        if (got.problem != asio::error::would_block) co_return got;
    } else {
        look_again_.arm(on_.now());
    }
    auto got = co_await bytes_.wait();
    co_return got;
}

bool shared_stream::deliver_to(stream_reader& reader) {
    deliver_to_ = &reader;
    look_again_.arm(on_.now());
    return true;
}

void shared_stream::deliver() {
    std::size_t delivered = 0;
    for (int left = reads_in_a_row; left > 0 && delivered < stream_reader::turn_bytes; --left) {
        into_ = deliver_to_->room();
        if (into_.size() == 0) return;
        const auto got = take();
        if (got.problem == asio::error::would_block) return;
        deliver_to_->on_bytes(got);
        if (got.problem || closed_) return;
        delivered += got.bytes;
    }
    look_again_.arm(on_.now());
}

// `would_block`: nothing yet, and the reader will hear of what comes.
transfer shared_stream::take() {
    const std::span<std::byte> into(static_cast<std::byte*>(into_.data()), into_.size());
    for (;;) {
        const bool gone = gone_.load(std::memory_order_relaxed);
        bool writer_waits = false;
        const auto count = reader_.read(into, writer_waits);
        if (!count) return {broken_rings(), 0};
        if (writer_waits) ring();
        if (*count > 0) return {{}, *count};
        if (gone || reader_.ended()) return {asio::error::eof, 0};
        if (on_.look_at(*this) || reader_.sleep()) return {asio::error::would_block, 0};
    }
}

void shared_stream::on_rung() {
    if (deliver_to_ && !closed_) {
        deliver();
    } else if (bytes_.waiting()) {
        reads_left_ = reads_in_a_row;
        auto got = take();
        if (got.problem != asio::error::would_block) bytes_.resume(got);
    }
    if (room_.waiting()) {
        auto problem = room();
        if (problem != asio::error::would_block) room_.resume({problem});
    }
}

void shared_stream::on_gone() {
    gone_.store(true, std::memory_order_relaxed);
    on_rung();
}

bool shared_stream::look() {
    if (!is_read()) return true;
    if (!reader_.ready()) return false;
    loop::turn in(on_);
    on_rung();
    return true;
}

void shared_stream::rest() {
    if (is_read() && !reader_.sleep()) look_again_.arm(on_.now());
}

// Also from another thread: signs of life.
transfer shared_stream::try_write(std::span<const asio::const_buffer> from) {
    if (closed_) return {asio::error::operation_aborted, 0};
    if (gone_.load(std::memory_order_relaxed)) return {asio::error::broken_pipe, 0};
    bool reader_sleeps = false;
    const auto count = writer_.write(from, reader_sleeps);
    if (!count) return {broken_rings(), 0};
    if (reader_sleeps) ring();
    if (*count > 0) return {{}, *count};
    return {asio::buffer_size(from) > 0 ? make_error_code(asio::error::would_block) : std::error_code(), 0};
}

std::error_code shared_stream::room() {
    if (gone_.load(std::memory_order_relaxed)) return asio::error::broken_pipe;
    const auto there = writer_.sleep_until_room();
    if (!there) return broken_rings();
    return *there ? std::error_code() : make_error_code(asio::error::would_block);
}

task<std::error_code> shared_stream::wait_writable() {
    if (closed_) co_return asio::error::operation_aborted;
    auto problem = room();
    if (problem != asio::error::would_block) co_return problem;
    auto ended = co_await room_.wait();
    co_return ended.problem;
}

std::optional<loan_reference> shared_stream::loan(const shared_bytes& content) {
    if (closed_) return std::nullopt;
    if (!lender_) lender_ = std::make_unique<lender>(block_pool::of(on_), memory_, ring_, socket_.fd());
    return lender_->loan(content);
}

void shared_stream::shutdown_write() {
    if (!closed_ && writer_.end()) ring();
}

void shared_stream::close() {
    if (std::exchange(closed_, true)) return;
    on_.forget(*this);
    look_again_.disarm();
    lender_.reset(); // still sends notices
    socket_.close();
    own_bell_.close();
    peer_bell_.reset();
    borrower_.reset();
    memory_.reset();
    bytes_.resume({asio::error::operation_aborted, 0});
    room_.resume({asio::error::operation_aborted});
}

// Full is as good as rung.
void shared_stream::ring() noexcept {
    const std::uint64_t once = 1;
    while (::write(peer_bell_.get(), &once, sizeof once) < 0 && errno == EINTR) {}
}

} // namespace

result<std::unique_ptr<stream>> make_stream(loop& on, ends over, std::string peer) {
    auto made = std::make_unique<shared_stream>(on, std::move(over), std::move(peer));
    if (auto problem = made->begin()) return io_failure("no shared memory: the loop cannot watch it", problem);
    return std::unique_ptr<stream>(std::move(made));
}

} // namespace ise::net::shm
