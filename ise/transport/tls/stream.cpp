#include <ise/transport/tls/stream.hpp>

#include <ise/core/verified_peer.hpp>
#include <ise/packet/codec.hpp>
#include <ise/transport/sealed_stream.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/proof.hpp>
#include <ise/transport/tls/psk.hpp>
#include <ise/wire/body.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>

#include <fmt/format.h>

#include <openssl/err.h>
#include <openssl/ssl.h>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <array>
#include <cstring>
#include <mutex>

namespace ise::net::tls {
namespace {

constexpr std::size_t record_bytes = 16 * 1024;
// A turn of writing encrypts at most this much before others get theirs.
constexpr std::size_t max_write = 256 * 1024;
// What OpenSSL answers by itself while nothing is read by the peer (updates of keys).
constexpr std::size_t max_unsent = 256 * 1024;
// After a failure this much is read yet, so that the peer sees why: a socket that closes over unread bytes takes the
// alert along.
constexpr std::size_t max_drained = 64 * 1024;

constexpr std::size_t sealed_begin = 5; // up to the type of a frame

enum class trouble { cut_off = 1, broken };

class trouble_category final : public std::error_category {
public:
    const char* name() const noexcept override { return "ise.tls"; }
    std::string message(int code) const override {
        return static_cast<trouble>(code) == trouble::cut_off ? "cut off, without TLS's end" : "TLS broke";
    }
};
std::error_code made(trouble what) {
    static const trouble_category category;
    return {static_cast<int>(what), category};
}

// Whether a side that was called is told in frames why not, who begins so; nothing: that is OpenSSL's to say.
std::optional<failure> stranger_to(const proof& with, bytes_view begin) {
    if (asks_for_tls(begin).value_or(true)) return std::nullopt;
    bool hello = begin.size() >= sealed_begin && begin[2] == std::byte{0} && begin[3] == std::byte{0} &&
                 begin[4] == static_cast<std::byte>(wire::frame_type::hello);
    if (!hello) return failure(errc::protocol_error, "it does not seal the session, nor is it a peer of ISE");
    return with.stranger(std::string_view(reinterpret_cast<const char*>(begin.data()), begin.size()));
}

class tls_stream : public stream, public verified_stream {
public:
    /// `host`: the one that is called; empty: this side was called.
    tls_stream(std::unique_ptr<stream> below, std::unique_ptr<proof> with, std::string host, std::string peer)
        : below_(std::move(below)), with_(std::move(with)), peer_(std::move(peer)) {
        shown_.host = std::move(host);
    }

    /// Shakes hands, once.
    task<std::error_code> shake_hands();

    task<transfer> read_some(asio::mutable_buffer into) override;
    transfer try_write(std::span<const asio::const_buffer> from) override;
    task<std::error_code> wait_writable() override;
    void limit_unsent(std::size_t most) override { below_->limit_unsent(most); }
    void shutdown_write() override;
    void close() override { below_->close(); }
    std::string peer() const override { return peer_; }
    void add_verified(verified_peer& to) const override {
        if (auto* below = dynamic_cast<const verified_stream*>(below_.get())) below->add_verified(to);
        std::lock_guard lock(mutex_);
        if (!greeted_) return;
        to.certificate = shown_.about.identity;
        to.serial = shown_.about.serial;
        to.chain = shown_.about.chain;
    }
    std::string_view what_began() const { return with_->what_began(); }
    std::optional<endpoint> local() const override { return with_->local(below_->local()); }
    std::optional<failure> verdict() const override {
        std::lock_guard lock(mutex_);
        return verdict_;
    }

private:
    std::error_code prepare();
    std::error_code step(bool& done);
    task<std::error_code> begin(std::vector<std::byte>& room);
    task<void> turn_away(const failure& why);
    task<void> let_it_be_known();
    std::error_code fail();
    void feed(const void* data, std::size_t size) { BIO_write(SSL_get_rbio(tls_.get()), data, static_cast<int>(size)); }
    std::error_code flush();

    std::unique_ptr<stream> below_;
    std::unique_ptr<proof> with_; // outlives tls_
    std::string peer_;
    bool greeted_ = false;

    // A sign of life is written from another thread.
    mutable std::mutex mutex_;
    shown_certificate shown_; // outlives tls_
    std::unique_ptr<SSL, decltype(&SSL_free)> tls_{nullptr, SSL_free};
    std::vector<std::byte> unsent_; // encrypted
    std::size_t sent_ = 0;
    // The last byte of what was encrypted is told as written when all of it has left: so nobody waits for a stream that
    // has said that everything went. The caller shows it again then.
    bool owed_ = false;
    std::error_code broken_;
    std::optional<failure> verdict_;
};

std::error_code tls_stream::prepare() {
    auto context = with_->context();
    std::lock_guard lock(mutex_);
    if (!context) {
        verdict_ = context.error();
        return broken_ = made(trouble::broken);
    }
    tls_.reset(SSL_new(context->get()));
    auto* in = BIO_new(BIO_s_mem());
    auto* out = BIO_new(BIO_s_mem());
    if (!tls_ || !in || !out) throw std::bad_alloc();
    BIO_set_mem_eof_return(in, -1); // nothing there yet is not the end
    BIO_set_mem_eof_return(out, -1);
    SSL_set_bio(tls_.get(), in, out);
    if (shown_.host.empty()) SSL_set_accept_state(tls_.get());
    else SSL_set_connect_state(tls_.get());
    if (with_->prepare(tls_.get(), shown_)) return {};
    verdict_ = with_->noted("tls");
    return broken_ = made(trouble::broken);
}

// OpenSSL has failed. With the mutex.
std::error_code tls_stream::fail() {
    auto noted = with_->noted("tls");
    if (!verdict_) verdict_ = shown_.objection ? *shown_.objection : std::move(noted);
    return broken_ = made(trouble::broken);
}

std::error_code tls_stream::step(bool& done) {
    std::lock_guard lock(mutex_);
    ERR_clear_error();
    int went = SSL_do_handshake(tls_.get());
    done = went == 1;
    if (!done && SSL_get_error(tls_.get(), went) != SSL_ERROR_WANT_READ) return fail();
    if (done) verdict_ = with_->missing(tls_.get());
    return verdict_ ? broken_ = made(trouble::broken) : std::error_code();
}

// Of the side that was called: looks at what comes first, which may be no TLS.
task<std::error_code> tls_stream::begin(std::vector<std::byte>& room) {
    std::size_t come = 0;
    while (with_->answers_strangers() && come < sealed_begin) {
        auto moved = co_await below_->read_some(asio::buffer(room.data() + come, room.size() - come));
        if (moved.problem) co_return moved.problem;
        come += moved.bytes;
    }
    if (come == 0) co_return std::error_code();
    auto why = stranger_to(*with_, bytes_view(room.data(), come));
    if (why) {
        co_await turn_away(*why);
        co_return broken_;
    }
    std::lock_guard lock(mutex_);
    feed(room.data(), come);
    co_return std::error_code();
}

// Who comes without TLS is told in frames, which he may read.
task<void> tls_stream::turn_away(const failure& why) {
    wire::farewell no;
    no.code = static_cast<std::uint8_t>(why.code());
    no.reason = why.message();
    buffer out;
    wire::put_frame(out, wire::frame_type::reject, 0, 0, [&](buffer& to) { encode(no, to); });
    {
        std::lock_guard lock(mutex_);
        verdict_ = why;
        broken_ = made(trouble::broken);
        auto* from = out.data();
        unsent_.assign(from, from + out.size());
        sent_ = 0;
    }
    co_await let_it_be_known();
}

task<std::error_code> tls_stream::shake_hands() {
    if (auto problem = prepare()) co_return problem;
    std::vector<std::byte> room(4096);
    if (shown_.host.empty()) {
        auto problem = co_await begin(room);
        if (problem) co_return problem;
    }
    for (;;) {
        bool done = false;
        if (auto problem = step(done)) {
            co_await let_it_be_known();
            co_return problem;
        }
        auto left = co_await wait_writable();
        if (left) co_return left;
        if (done) break;
        auto moved = co_await below_->read_some(asio::buffer(room));
        if (moved.problem) co_return moved.problem;
        std::lock_guard lock(mutex_);
        feed(room.data(), moved.bytes);
    }
    greeted_ = true;
    co_return std::error_code();
}

// The alert goes, and what the peer sent before it saw that is read.
task<void> tls_stream::let_it_be_known() {
    auto left = co_await wait_writable();
    if (left) co_return;
    below_->shutdown_write();
    std::vector<std::byte> room(4096);
    for (std::size_t drained = 0; drained < max_drained;) {
        auto moved = co_await below_->read_some(asio::buffer(room));
        if (moved.problem) co_return;
        drained += moved.bytes;
    }
}

// Gives what was encrypted to the stream below. With the mutex, which a wait for the handshake does not need.
std::error_code tls_stream::flush() {
    auto* out = SSL_get_wbio(tls_.get());
    for (;;) {
        if (unsent_.empty()) {
            auto waiting = BIO_ctrl_pending(out);
            if (waiting == 0) return {};
            if (waiting > max_unsent) return broken_ = made(trouble::broken);
            unsent_.resize(waiting);
            BIO_read(out, unsent_.data(), static_cast<int>(waiting));
            sent_ = 0;
        }
        asio::const_buffer rest(unsent_.data() + sent_, unsent_.size() - sent_);
        auto wrote = below_->try_write(std::span(&rest, 1));
        sent_ += wrote.bytes;
        if (wrote.problem) return wrote.problem;
        if (sent_ == unsent_.size()) unsent_.clear();
    }
}

task<transfer> tls_stream::read_some(asio::mutable_buffer into) {
    if (!greeted_) {
        auto problem = co_await shake_hands();
        if (problem) co_return transfer{problem, 0};
    }
    for (;;) {
        {
            std::lock_guard lock(mutex_);
            ERR_clear_error();
            std::size_t count = 0;
            int went = SSL_read_ex(tls_.get(), into.data(), into.size(), &count);
            int how = SSL_get_error(tls_.get(), went);
            if (went == 1) co_return transfer{{}, count};
            if (how == SSL_ERROR_ZERO_RETURN) co_return transfer{asio::error::eof, 0};
            if (how != SSL_ERROR_WANT_READ) co_return transfer{fail(), 0};
            flush(); // what it answered by itself goes now, or with what is written next
        }
        auto moved = co_await below_->read_some(into); // decrypted it is no longer
        if (moved.problem == asio::error::eof) moved.problem = made(trouble::cut_off);
        if (moved.problem) co_return transfer{moved.problem, 0};
        std::lock_guard lock(mutex_);
        feed(into.data(), moved.bytes);
    }
}

transfer tls_stream::try_write(std::span<const asio::const_buffer> from) {
    std::lock_guard lock(mutex_);
    if (broken_) return {broken_, 0};
    if (!greeted_) return {asio::error::would_block, 0};
    if (auto problem = flush()) return {problem, 0};
    std::size_t done = std::exchange(owed_, false) ? 1 : 0;
    std::array<std::byte, record_bytes> record;
    std::size_t skipped = done, at = 0, within = 0; // where the next byte lies in `from`
    while (done < max_write) {
        std::size_t filled = 0;
        while (at < from.size() && filled < record.size()) {
            auto left = from[at].size() - within;
            auto pass = std::min(left, skipped);
            skipped -= pass;
            auto count = std::min(left - pass, record.size() - filled);
            if (count > 0)
                std::memcpy(record.data() + filled, static_cast<const std::byte*>(from[at].data()) + within + pass,
                            count);
            filled += count;
            within += pass + count;
            if (within == from[at].size()) ++at, within = 0;
        }
        if (filled == 0) break;
        ERR_clear_error();
        std::size_t taken = 0;
        if (SSL_write_ex(tls_.get(), record.data(), filled, &taken) != 1 || taken != filled) return {fail(), done};
        done += filled;
        auto problem = flush();
        if (problem == asio::error::would_block) {
            owed_ = true;
            --done;
            return {done > 0 ? std::error_code() : problem, done};
        }
        if (problem) return {problem, done};
    }
    return {{}, done};
}

task<std::error_code> tls_stream::wait_writable() {
    for (;;) {
        {
            std::lock_guard lock(mutex_);
            if (!tls_) co_return asio::error::not_connected;
            auto problem = flush();
            if (problem != asio::error::would_block) co_return problem;
        }
        auto problem = co_await below_->wait_writable();
        if (problem) co_return problem;
    }
}

void tls_stream::shutdown_write() {
    std::lock_guard lock(mutex_);
    if (greeted_ && !broken_) {
        SSL_shutdown(tls_.get());
        flush();
        ERR_clear_error();
    }
    below_->shutdown_write();
}

class tls_by_key final : public tls_stream, public sealed_stream {
public:
    using tls_stream::tls_stream;
};

std::unique_ptr<tls_stream> make(loop& on, std::unique_ptr<stream> below, std::shared_ptr<identity> with,
                                 std::string host) {
    auto peer = below->peer();
    auto rest = peer.find("://");
    peer = "tls" + (rest == peer.npos ? "://" + peer : peer.substr(rest));
    return std::make_unique<tls_stream>(std::move(below), by_certificate(std::move(with), on.env()), std::move(host),
                                        std::move(peer));
}

std::unique_ptr<tls_stream> make(loop&, std::unique_ptr<stream> below, std::shared_ptr<const shared_key> with,
                                 std::string host) {
    auto peer = below->peer();
    return std::make_unique<tls_by_key>(std::move(below), by_key(std::move(with)), std::move(host), std::move(peer));
}

task<result<std::unique_ptr<stream>>> shaken(std::unique_ptr<tls_stream> secured, endpoint to) {
    auto problem = co_await secured->shake_hands();
    if (!problem) co_return std::unique_ptr<stream>(std::move(secured));
    if (problem == asio::error::operation_aborted) co_return failure(errc::cancelled, "connecting was cancelled");
    auto why = secured->verdict();
    if (why) co_return failure(why->code(), fmt::format("{}: {}", to.text(), why->message()));
    auto text = problem == asio::error::eof
                    ? fmt::format("closed the connection when {} was to begin{}", secured->what_began(),
                                  dynamic_cast<sealed_stream*>(secured.get())
                                      ? ": it is overloaded, or of a version that seals none (ISE_KEY_LEGACY=1)"
                                      : "")
                    : problem.message();
    co_return failure(errc::unreachable, fmt::format("{}: {}", to.text(), text));
}

} // namespace

std::unique_ptr<stream> answer(loop& on, std::unique_ptr<stream> below, std::shared_ptr<identity> with) {
    return make(on, std::move(below), std::move(with), std::string());
}

std::unique_ptr<stream> answer(loop& on, std::unique_ptr<stream> below, std::shared_ptr<const shared_key> with) {
    return make(on, std::move(below), std::move(with), std::string());
}

task<result<std::unique_ptr<stream>>> greet(loop& on, std::unique_ptr<stream> below, std::shared_ptr<identity> with,
                                            endpoint to) {
    auto secured = make(on, std::move(below), std::move(with), to.host);
    auto got = co_await shaken(std::move(secured), std::move(to));
    co_return got;
}

task<result<std::unique_ptr<stream>>> greet(loop& on, std::unique_ptr<stream> below,
                                            std::shared_ptr<const shared_key> with, endpoint to) {
    auto secured = make(on, std::move(below), std::move(with), to.text());
    auto got = co_await shaken(std::move(secured), std::move(to));
    co_return got;
}

} // namespace ise::net::tls
