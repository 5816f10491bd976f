#include <ise/transport/udp/association.hpp>

#include <ise/core/environment.hpp>

#include <asio/error.hpp>

namespace ise::net::udp {
namespace {

constexpr int max_at_once = 64; // datagrams of one flush; others get their turn
constexpr duration until_the_kernel_has_room = std::chrono::milliseconds(1);

} // namespace

association::association(loop& on, std::shared_ptr<association_port> of, std::uint64_t id, std::uint64_t peer_id,
                         endpoint peer)
    : on_(on), port_(std::move(of)), id_(id), first_peer_(peer), peer_(std::move(peer)), channel_(peer_id),
      timer_(on, [this] { on_timer(); }), readable_(on,
                                                    [this] {
                                                        cancelled_ = true;
                                                        readable_.resume();
                                                    }),
      writable_(on, [this] {
          cancelled_ = true;
          writable_.resume();
      }) {}

void association::use(std::weak_ptr<datagram_stream::user> receiver) {
    user_ = std::move(receiver);
    used_ = true;
    channel_.take_messages();
    if (auto to = user_.lock()) hand_over(*to);
}

// It may leave while it takes.
void association::hand_over(datagram_stream::user& receiver) {
    auto& in = channel_.in();
    if (in.readable()) {
        const auto content = in.ready();
        receiver.on_content(content);
        in.consume(content.size());
    }
    if (!gone_ && in.room_grew()) soon(); // the peer may send more
}

void association::on_datagram(const endpoint& from, bytes_view body) {
    channel::events happened;
    if (!channel_.take(body, on_.now(), happened)) {
        // Duplicates are no reason to do anything, and who breaks a rule is told nothing.
        return;
    }
    follow(from, happened);
    if (auto receiver = user_.lock()) {
        receiver->on_heard();
        for (const auto& message : happened.messages)
            if (!left_) receiver->on_message(message);
        if (!left_) hand_over(*receiver);
    }
    if (channel_.in().readable() || channel_.in().ended()) readable_.resume();
    if (gone_) return;
    if (left_ || channel_.wanting(on_.now())) soon();
    else rearm();
}

void association::on_sign(const endpoint& from) {
    if (from != peer_) return;
    if (auto receiver = user_.lock()) receiver->on_sign();
}

bool association::show_sign() noexcept {
    buffer out(wire::frame_header::size);
    wire::put_datagram(out, wire::datagram_type::sign, channel_.peer_id());
    auto lock = port_->lock();
    return !port_->send(peer_, out.view());
}

// The peer's address may change under way (a router forgot it): whoever knows our id is followed, but to an address
// that it did not prove to receive at goes nothing but the question.
void association::follow(const endpoint& from, const channel::events& happened) {
    if (happened.challenge) send_probe(from, wire::chunk_type::response, *happened.challenge);
    if (from == peer_) return;
    if (!candidate_ || candidate_->where != from) {
        candidate made;
        made.where = from;
        made.challenge = on_.env().random();
        candidate_ = std::move(made);
    }
    if (happened.response == candidate_->challenge) {
        auto lock = port_->lock();
        peer_ = from;
        candidate_.reset();
    } else {
        send_probe(from, wire::chunk_type::challenge, candidate_->challenge);
    }
}

void association::send_probe(const endpoint& to, wire::chunk_type type, std::uint64_t value) {
    buffer out(64);
    channel_.put_probe(out, type, value);
    port_->send(to, out.view());
}

void association::flush() {
    if (gone_ || on_.abandoned()) return;
    auto now = on_.now();
    auto& out = port_->scratch();
    bool stuck = false;
    for (int count = 0; count < max_at_once; ++count) {
        out.clear();
        if (!channel_.next(out, now)) break;
        // What the kernel does not take is lost like anything else, and is sent again.
        stuck = port_->send(peer_, out.view()) == asio::error::would_block;
        if (stuck) break;
    }
    if (channel_.out().writable()) writable_.resume();
    if (room_asked_ && channel_.out().messages().wanted()) {
        room_asked_ = false;
        if (auto receiver = user_.lock()) receiver->on_room();
    }
    if (left_ && (channel_.out().settled() || (drain_until_ && now >= *drain_until_))) return part(true);
    if (stuck) {
        timer_.arm(now + until_the_kernel_has_room);
    } else {
        rearm();
    }
}

void association::rearm() {
    auto at = channel_.due(on_.now());
    if (drain_until_) at = std::min(at, *drain_until_);
    if (at == time_point::max()) {
        timer_.disarm();
    } else {
        timer_.arm(at);
    }
}

void association::on_timer() {
    if (gone_) return;
    channel_.on_timer(on_.now());
    soon();
}

std::optional<transfer> association::read(asio::mutable_buffer into) {
    transfer got;
    if (left_ || cancelled_) {
        got.problem = asio::error::operation_aborted;
        return got;
    }
    // Who is handed what comes has not kept `into`: what a datagram left that broke a rule comes with the next good
    // one.
    if (!used_) got.bytes = channel_.in().read(std::span(static_cast<std::byte*>(into.data()), into.size()));
    if (got.bytes > 0) {
        if (!gone_ && channel_.in().room_grew()) soon(); // the peer may send more
        return got;
    }
    if (!channel_.in().ended() && !gone_) return {};
    got.problem = asio::error::eof;
    return got;
}

transfer association::write(std::span<const asio::const_buffer> from) {
    transfer done;
    done.problem = writable();
    if (done.problem) return done;
    for (const auto& part : from) {
        auto taken = channel_.out().write(bytes_view(static_cast<const std::byte*>(part.data()), part.size()));
        done.bytes += taken;
        if (taken < part.size()) break;
    }
    soon();
    return done;
}

std::error_code association::writable() const noexcept {
    if (left_ || cancelled_) return asio::error::operation_aborted;
    if (gone_) return asio::error::connection_reset;
    if (channel_.out().ended()) return asio::error::shut_down;
    return channel_.out().writable() ? std::error_code() : asio::error::would_block;
}

bool association::message_wanted() noexcept {
    if (left_ || gone_) return false;
    if (channel_.out().messages().wanted()) return true;
    room_asked_ = true;
    return false;
}

void association::put_message(std::uint64_t key, const wire::frame_header& header, bytes_view head,
                              const shared_bytes& payload) {
    channel_.out().messages().put(key, header, head, payload);
    soon();
}

void association::shutdown_write() {
    if (left_ || gone_) return;
    channel_.out().end();
    soon();
}

void association::leave() {
    if (std::exchange(left_, true)) return;
    auto self = shared_from_this();
    user_.reset();
    readable_.resume();
    writable_.resume();
    if (gone_ || on_.abandoned()) return part(false);
    channel_.out().end();
    if (!channel_.out().settled() && port_->lets_drain()) {
        drain_until_ = saturating_add(on_.now(), max_drain);
        soon();
        return;
    }
    flush();
    part(true);
}

void association::part(bool tell) {
    if (!std::exchange(gone_, true) && tell) {
        buffer out(wire::frame_header::size);
        wire::put_datagram(out, wire::datagram_type::closed, channel_.peer_id());
        port_->send(peer_, out.view());
    }
    timer_.disarm();
    port_->forget(*this);
}

void association::on_gone() {
    auto self = shared_from_this();
    gone_ = true;
    timer_.disarm();
    readable_.resume();
    writable_.resume();
    port_->forget(*this);
}

void association::on_port_closed() {
    gone_ = true;
    timer_.disarm();
    readable_.resume();
    writable_.resume();
}

} // namespace ise::net::udp
