#include <ise/transport/udp/association.hpp>

#include <ise/core/environment.hpp>

#include <ise/packet/codec.hpp>
#include <ise/transport/tls/psk.hpp>
#include <ise/wire/body.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>
#include <ise/wire/sealed_datagram.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <string_view>

namespace ise::net::udp {
namespace {

constexpr int max_at_once = 64; // datagrams of one flush; others get their turn
constexpr duration until_the_kernel_has_room = std::chrono::milliseconds(1);
constexpr duration first_flight_pause = std::chrono::milliseconds(200);
constexpr duration max_flight_pause = std::chrono::seconds(2);

wire::datagram_type type_of(bytes_view datagram) noexcept {
    return static_cast<wire::datagram_type>(wire::read_header(datagram.data()).type);
}

} // namespace

association::association(loop& on, std::shared_ptr<association_port> of, std::uint64_t id, std::uint64_t peer_id,
                         endpoint peer, std::unique_ptr<seal> with)
    : on_(on), port_(std::move(of)), id_(id), first_peer_(peer), peer_(std::move(peer)), seal_(std::move(with)),
      channel_(peer_id, seal_ ? wire::sealed::seal_bytes : 0), timer_(on, [this] { on_timer(); }), readable_(on),
      writable_(on) {}

void association::use(std::weak_ptr<datagram_stream::user> receiver) {
    user_ = std::move(receiver);
    channel_.take_messages();
    if (auto held = user_.lock()) hand_over();
}

// It may leave while it takes.
[[gnu::hot]] void association::hand_over() {
    auto& in = channel_.in();
    while (!left_ && reader_ && in.readable()) {
        const auto room = reader_->room();
        if (room.size() == 0) return;
        transfer got;
        got.bytes = in.read(std::span(static_cast<std::byte*>(room.data()), room.size()));
        reader_->on_bytes(got);
    }
    if (!gone_ && in.room_grew()) soon(); // the peer may send more
}

void association::begin() {
    calls_ = true;
    if (!seal_) return;
    if (seal_->trouble()) return fail(*seal_->trouble());
    send_flight();
}

// The side that calls asks again until it is answered; the other one answers.
void association::send_flight() {
    // Nobody answers the refusal of the side that calls, and it is gone then.
    constexpr int refusals = 3;
    const int times = calls_ && seal_->trouble() ? refusals : 1;
    for (int time = 0; time < times; ++time) {
        for (const auto& part : seal_->flight()) {
            buffer out(wire::datagram_bytes);
            wire::put_datagram(out, wire::sealed::flight, channel_.peer_id(), part);
            port_->send(peer_, out.view());
        }
    }
    if (!calls_ || seal_->flight().empty()) return;
    flight_pause_ = flight_pause_ == duration() ? first_flight_pause : std::min(flight_pause_ * 2, max_flight_pause);
    flight_at_ = on_.now() + flight_pause_;
    rearm();
}

// A peer that has sent sealed data has got the last flight, too: what comes after that is late, or a stranger's.
void association::on_flight(const endpoint& from, bytes_view body) {
    if (from != peer_ || plain_ || gone_ || (calls_ && heard_)) return;
    if (!seal_) { // it is asked for a seal that it does not know: the answer is one flight
        const bool first = body.size() > 2 && body[0] == std::byte{1} && body[1] == std::byte{0};
        if (calls_ || heard_ || !first) return;
        auto record = tls::record_of(port_->old_scheme() ? tls::refusal::old_scheme : tls::refusal::no_key);
        bytes said{std::byte{2}, std::byte{0}, std::byte{1}};
        said.insert(said.end(), record.begin(), record.end());
        buffer out;
        wire::put_datagram(out, wire::sealed::flight, channel_.peer_id(), said);
        port_->send(peer_, out.view());
        if (std::exchange(refused_, true)) return;
        return fail({errc::unauthorized, std::string(tls::why_no_seal(port_->old_scheme()))});
    }
    const bool was_sealed = seal_->sealed();
    if (seal_->take_flight(body)) send_flight();
    if (seal_->trouble() && !verdict_) return fail(*seal_->trouble());
    if (!seal_->sealed() || was_sealed) return;
    soon();
    port_->on_settled();
}

// There is no session, and its user hears why.
void association::fail(const failure& why) {
    verdict_ = why;
    flight_at_ = time_point::max();
    readable_.resume();
    writable_.resume();
    port_->on_settled();
}

// A peer that does not seal is told so in its own words; nothing that it says counts.
void association::turn_away(bytes_view body) {
    plain_ = true;
    channel_.stay_plain();
    auto text = std::string_view(reinterpret_cast<const char*>(body.data()), body.size());
    auto why = seal_->stranger(text);
    wire::farewell no;
    no.code = static_cast<std::uint8_t>(why.code());
    no.reason = why.message();
    buffer out;
    wire::put_frame(out, wire::frame_type::reject, 0, 0, [&](buffer& to) { encode(no, to); });
    channel_.out().write(out.view());
    channel_.out().end();
    fail(why);
}

void association::seal_it(buffer& datagram) {
    if (seal_ && !plain_) seal_->close(datagram, channel_.out().acked(), on_.now());
}

[[gnu::hot]] void association::on_datagram(const endpoint& from, bytes_view datagram) {
    if (!is_read()) return;
    const bool sealed = type_of(datagram) == wire::sealed::data;
    const auto received = datagram.subspan(wire::frame_header::size);
    if (!seal_ || plain_) {
        if (!sealed) take(from, received);
        return;
    }
    if (sealed) {
        if (!seal_->sealed() || !channel_.fresh(received)) return;
        auto body = seal_->open(datagram);
        if (!body) return;              // somebody else's, or changed on the way
        flight_at_ = time_point::max(); // the last flight came
        take(from, *body);
    } else if (!calls_ && !seal_->begun() && from == peer_) {
        turn_away(received);
        take(from, received);
    }
}

[[gnu::hot]] void association::take(const endpoint& from, bytes_view body) {
    channel::events happened;
    if (!channel_.take(body, on_.now(), happened)) {
        // Duplicates are no reason to do anything, and who breaks a rule is told nothing.
        return;
    }
    heard_ = true;
    if (happened.closed && seal_ && !plain_) return on_gone();
    follow(from, happened);
    if (auto receiver = user_.lock()) {
        receiver->on_heard();
        for (const auto& message : happened.messages)
            if (!left_) receiver->on_message(message);
        if (!left_) hand_over();
    }
    if (channel_.in().readable() || channel_.in().ended()) {
        woken_at_ = on_.now();
        readable_.resume();
    }
    if (gone_) return;
    if (left_ || channel_.wanting(on_.now())) soon();
    else rearm();
}

void association::on_sign(const endpoint& from, bytes_view datagram) {
    if (from != peer_) return;
    const bool sealed = type_of(datagram) == wire::sealed::sign;
    if (sealed != (seal_ != nullptr)) return;
    if (seal_ && (!seal_->sealed() || !seal_->take_sign(datagram))) return;
    if (auto receiver = user_.lock()) receiver->on_sign();
}

bool association::show_sign() noexcept {
    buffer out(64);
    auto lock = port_->lock();
    if (!seal_) wire::put_datagram(out, wire::datagram_type::sign, channel_.peer_id());
    else if (seal_->sealed()) seal_->put_sign(out, channel_.peer_id());
    else return false;
    return !port_->send(peer_, out.view());
}

// The peer's address may change under way (a router forgot it): whoever knows our id is followed, but to an address
// that it did not prove to receive at goes nothing but the question.
[[gnu::hot]] void association::follow(const endpoint& from, const channel::events& happened) {
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
    seal_it(out);
    port_->send(to, out.view());
}

[[gnu::hot]] void association::flush() {
    if (gone_ || on_.abandoned() || refuses_) return;
    if (!may_send()) return rearm();
    auto now = on_.now();
    auto& out = port_->scratch();
    bool stuck = false;
    for (int count = 0; count < max_at_once; ++count) {
        out.clear();
        if (!channel_.next(out, now)) break;
        seal_it(out);
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

[[gnu::hot]] void association::rearm() {
    auto at = may_send() ? channel_.due(on_.now()) : time_point::max();
    at = std::min(at, flight_at_);
    if (drain_until_) at = std::min(at, *drain_until_);
    if (at == time_point::max()) {
        timer_.disarm();
    } else {
        timer_.arm(at);
    }
}

void association::on_timer() {
    if (gone_) return;
    if (refuses_) return part(false);
    if (flight_at_ <= on_.now()) send_flight();
    channel_.on_timer(on_.now());
    soon();
}

std::optional<transfer> association::read(asio::mutable_buffer into) {
    transfer got;
    if (left_) {
        got.problem = asio::error::operation_aborted;
        return got;
    }
    if (verdict_) {
        got.problem = asio::error::connection_aborted;
        return got;
    }
    // Who is handed what comes has not kept `into`: what a datagram left that broke a rule comes with the next good
    // one.
    if (!reader_) got.bytes = channel_.in().read(std::span(static_cast<std::byte*>(into.data()), into.size()));
    if (got.bytes > 0) {
        if (!gone_ && channel_.in().room_grew()) soon(); // the peer may send more
        return got;
    }
    if (!channel_.in().ended() && !gone_) return {};
    // The end that the peer gave it says more.
    got.problem = broken_ && !channel_.in().ended() ? broken_ : asio::error::eof;
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
    if (left_) return asio::error::operation_aborted;
    if (verdict_) return asio::error::connection_aborted;
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

void association::forget_messages(std::uint64_t key) noexcept {
    channel_.out().messages().forget(key);
    if (room_asked_ && !left_ && !gone_) soon(); // there may be room for others
}

void association::shutdown_write() {
    if (left_ || gone_) return;
    channel_.out().end();
    soon();
}

// Of the side that was called: a peer that asks again has not heard the refusal.
bool association::repeats_refusal() const noexcept {
    if (calls_ || plain_ || gone_ || !verdict_) return false;
    return seal_ ? !seal_->sealed() && !seal_->flight().empty() : refused_;
}

void association::leave() {
    if (std::exchange(left_, true)) return;
    auto self = shared_from_this();
    user_.reset();
    readable_.resume();
    writable_.resume();
    if (!on_.abandoned() && repeats_refusal()) {
        if (!port_->lets_refuse()) return part(false);
        refuses_ = true;
        drain_until_ = saturating_add(on_.now(), refusal_time);
        timer_.arm(*drain_until_);
        return;
    }
    if (gone_ || on_.abandoned() || !may_send()) return part(false);
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
        buffer out(64);
        if (seal_ && !plain_) {
            channel_.put_probe(out, wire::sealed::closed, 0);
            seal_it(out);
        } else {
            wire::put_datagram(out, wire::datagram_type::closed, channel_.peer_id());
        }
        port_->send(peer_, out.view());
    }
    timer_.disarm();
    port_->forget(*this);
}

void association::on_said_gone() {
    if (!seal_ || plain_) on_gone();
}

void association::on_gone() {
    auto self = shared_from_this();
    gone_ = true;
    timer_.disarm();
    readable_.resume();
    writable_.resume();
    port_->forget(*this);
}

void association::on_port_closed(const std::error_code& why) {
    gone_ = true;
    broken_ = why;
    timer_.disarm();
    readable_.resume();
    writable_.resume();
}

} // namespace ise::net::udp
