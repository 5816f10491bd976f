#include <ise/net/handshake.hpp>

#include <ise/core/limits.hpp>
#include <ise/core/object_stream.hpp>
#include <ise/core/verified_peer.hpp>
#include <ise/net/authentication.hpp>
#include <ise/packet/codec.hpp>
#include <ise/transport/sealed_stream.hpp>
#include <ise/transport/tls/psk.hpp>
#include <ise/wire/body.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/format.h>

#include <algorithm>

namespace ise::net {
namespace {

using wire::frame_type;

constexpr std::uint64_t min_heartbeat_ns = 20'000'000;
constexpr std::uint64_t max_heartbeat_ns = 3'600'000'000'000;
constexpr std::uint64_t largest_message_bytes = 0xffff'0000; // a frame's header counts in 32 bits

wire::limits bounded(wire::limits offered) {
    offered.heartbeat_ns = std::clamp(offered.heartbeat_ns, min_heartbeat_ns, max_heartbeat_ns);
    offered.max_frame_bytes = std::max(offered.max_frame_bytes, wire::min_frame_limit);
    offered.max_message_bytes = std::min(offered.max_message_bytes, largest_message_bytes);
    return offered;
}

// A stream during the handshake: closed at the deadline, so that whoever waits on it goes on.
class greeting {
public:
    greeting(loop& on, std::unique_ptr<stream> transport, time_point deadline, const shared_key* key,
             std::string_view deadline_name = {})
        : on_(on), transport_(std::move(transport)), parser_(limit::greeting_bytes, "greeting_bytes"),
          keys_(key, on.env()), deadline_name_(deadline_name), alarm_(on, [this] {
              late_ = true;
              transport_->close();
          }) {
        alarm_.arm(deadline);
    }

    task<result<wire::frame>> receive() {
        for (;;) {
            auto found = parser_.next();
            if (!found && tls::asks_for_tls(begin_).value_or(false)) {
                auto why = co_await refuse_tls();
                co_return why;
            }
            if (!found) co_return found.error();
            if (*found) {
                keys_.note((*found)->header, (*found)->body);
                co_return **found;
            }
            auto room = parser_.prepare();
            auto got = co_await transport_->read_some(asio::buffer(room.data(), room.size()));
            if (got.problem) co_return broken(got.problem);
            note_begin(room.data(), got.bytes);
            parser_.commit(got.bytes);
        }
    }

    template <class Body>
    task<result<void>> send(frame_type type, const Body& body) {
        buffer out;
        wire::put_frame(out, type, 0, 0, [&](buffer& to) { encode(body, to); });
        keys_.note(wire::read_header(out.data()), out.view().subspan(wire::frame_header::size));
        return send(std::move(out));
    }

    task<result<void>> send(buffer out) {
        sent_at_ = on_.env().now();
        for (std::size_t sent = 0; sent < out.size();) {
            asio::const_buffer rest(out.data() + sent, out.size() - sent);
            auto wrote = transport_->try_write(std::span(&rest, 1));
            sent += wrote.bytes;
            if (wrote.problem == asio::error::would_block) wrote.problem = co_await transport_->wait_writable();
            if (wrote.problem) co_return broken(wrote.problem);
        }
        co_return result<void>();
    }

    /// What the transport carries sets a limit of its own, and may do more than others.
    wire::limits fitting(wire::limits offered) const {
        if (auto* datagrams = dynamic_cast<datagram_stream*>(transport_.get()))
            offered.max_message_bytes = std::min(offered.max_message_bytes, datagrams->max_message_bytes());
        return offered;
    }

    std::uint64_t fitting(std::uint64_t features) const {
        if (dynamic_cast<object_stream*>(transport_.get())) features |= wire::feature::objects;
        if (dynamic_cast<loans*>(transport_.get())) features |= wire::feature::loans;
        return features;
    }

    /// What the transport knows of the peer, and what the handshake has shown; once it has greeted.
    verified_peer verified(bool has_key) const {
        verified_peer made;
        made.from = peer();
        made.same_process = dynamic_cast<object_stream*>(transport_.get()) != nullptr;
        made.has_key = has_key;
        if (auto* known = dynamic_cast<verified_stream*>(transport_.get())) known->add_verified(made);
        return made;
    }

    authentication& keys() noexcept { return keys_; }
    /// Our clock, when the last frame was sent.
    time_point sent_at() const noexcept { return sent_at_; }
    std::string peer() const { return transport_->peer(); }
    failure strange(const wire::frame& came) const {
        return {errc::protocol_error,
                fmt::format("{} sent '{}' instead of a greeting", peer(), wire::name_of(came.header.type))};
    }
    std::shared_ptr<connection> done(loop& on, session_terms terms) {
        alarm_.disarm();
        return std::make_shared<connection>(on, std::move(transport_), std::move(terms), std::move(parser_));
    }

private:
    failure broken(const std::error_code& problem) const {
        if (late_) return {errc::timed_out, fmt::format("{} did not greet in time{}", peer(), deadline_name_)};
        if (auto refused = transport_->verdict())
            return {refused->code(), fmt::format("{}: {}", peer(), refused->message())};
        if (problem == asio::error::operation_aborted) return {errc::cancelled, "the handshake was cancelled"};
        std::string why =
            problem == asio::error::eof ? "closed the connection during the handshake" : problem.message();
        return {errc::peer_lost, fmt::format("{}: {}", peer(), why)};
    }

    void note_begin(const std::byte* from, std::size_t count) {
        constexpr std::size_t wanted = 3;
        if (begin_.size() < wanted) begin_.insert(begin_.end(), from, from + std::min(count, wanted - begin_.size()));
    }

    // The peer seals its sessions, or has tls://: it is told in its own words.
    task<failure> refuse_tls() {
        buffer out;
        auto record = tls::record_of(keys_.demanded() ? tls::refusal::old_scheme : tls::refusal::no_key);
        out.append(bytes_view(record));
        auto outcome = co_await send(std::move(out));
        if (!outcome) co_return outcome.error();
        co_return failure(errc::unauthorized, fmt::format("{}: received TLS on an endpoint without TLS: {}", peer(),
                                                          tls::why_no_seal(keys_.demanded())));
    }

    loop& on_;
    std::unique_ptr<stream> transport_;
    wire::parser parser_;
    authentication keys_;
    bytes begin_; // the first of all
    time_point sent_at_{};
    std::string_view deadline_name_; // of the limit, in brackets
    timer alarm_;
    bool late_ = false;
};

bool is_sealed(const stream& one) { return dynamic_cast<const sealed_stream*>(&one) != nullptr; }

failure farewell_of(const std::string& peer, const wire::frame& came) {
    auto why = wire::read_body<wire::farewell>(came.body);
    if (!why) return {errc::protocol_error, fmt::format("{} rejected the session with an unreadable reason", peer)};
    return {static_cast<errc>(why->code), fmt::format("{} rejected the session: {}", peer, why->reason)};
}

failure did_not_prove(const std::string& peer, std::string_view how) {
    return {errc::unauthorized,
            fmt::format("{} did not prove that it knows the shared key of this side: {}", peer, how)};
}

// Of the initiator: answers a challenge. The frame that came is the welcome or the reject then.
task<result<wire::frame>> answer_challenge(greeting& with, wire::frame came) {
    if (came.header.type == frame_type::welcome)
        co_return did_not_prove(with.peer(), "it has no key, or is of a version that knows of none");
    if (came.header.type != frame_type::challenge) co_return came;
    auto challenge = wire::read_body<wire::credentials>(came.body);
    if (!challenge) co_return challenge.error();
    if (auto strange = with.keys().strange_challenge(*challenge))
        co_return failure(strange->code(), fmt::format("{}: {}", with.peer(), strange->message()));
    auto proof = with.keys().proof(true);
    auto sent = co_await with.send(frame_type::proof, proof);
    if (!sent) co_return sent.error();
    auto next = co_await with.receive();
    co_return next;
}

// Of either side: the next frame is the proof of the other one.
task<result<bool>> proof_comes(greeting& with, bool of_initiator) {
    auto wanted = with.keys().proof(of_initiator); // of what was said before it
    auto came = co_await with.receive();
    if (!came) co_return came.error();
    if (came->header.type == frame_type::reject) co_return farewell_of(with.peer(), *came);
    bool plain = came->header.flags == 0 && came->header.id == 0; // nothing proves the head of a proof
    if (came->header.type != frame_type::proof || !plain) co_return with.strange(*came);
    auto given = wire::read_body<wire::credentials>(came->body);
    if (!given) co_return given.error();
    co_return authentication::same(wanted, *given);
}

// Of the responder: whether the initiator may come in as far as the key goes.
task<result<void>> demand_proof(greeting& with, const wire::credentials& offered) {
    if (auto objection = with.keys().objection(offered)) co_return std::move(*objection);
    if (!with.keys().demanded()) co_return result<void>();
    auto challenge = with.keys().offer();
    auto sent = co_await with.send(frame_type::challenge, challenge);
    if (!sent) co_return sent.error();
    auto proved = co_await proof_comes(with, true);
    if (!proved) co_return proved.error();
    if (*proved) co_return result<void>();
    co_return failure(errc::unauthorized, "the shared key here is another one");
}

// What a hello says of versions.
std::optional<failure> unspeakable(const wire::hello& theirs) {
    if (theirs.magic != wire::magic) return failure(errc::protocol_error, "the hello does not begin with ISE's mark");
    if (theirs.oldest <= wire::newest_version && theirs.newest >= wire::oldest_version) return {};
    return failure(errc::version_mismatch,
                   fmt::format("wire versions {} to {} are spoken here, {} to {} were offered", wire::oldest_version,
                               wire::newest_version, theirs.oldest, theirs.newest));
}

// Of the initiator: who answers in place of the component that the hello asked for.
std::optional<std::string> somebody_else(const wire::hello& mine, const wire::identity& theirs) {
    if (!mine.wanted_path.empty() && theirs.path != mine.wanted_path)
        return fmt::format("'{}', not '{}'", theirs.path, mine.wanted_path);
    if (mine.wanted_incarnation != 0 && theirs.incarnation != mine.wanted_incarnation)
        return fmt::format("another life of '{}'", theirs.path);
    return {};
}

} // namespace

task<result<std::shared_ptr<connection>>> initiate(loop& on, std::unique_ptr<stream> transport, wire::hello mine,
                                                   time_point deadline, const shared_key* key) {
    const bool has_key = key != nullptr;
    if (is_sealed(*transport)) key = nullptr; // it is proved
    greeting with(on, std::move(transport), deadline, key);
    mine.accepts = with.fitting(mine.accepts);
    mine.features = with.fitting(mine.features);
    mine.authentication = with.keys().offer();
    auto sent = co_await with.send(frame_type::hello, mine);
    if (!sent) co_return sent.error();
    auto came = co_await with.receive();
    if (!came) co_return came.error();
    if (key) {
        auto next = co_await answer_challenge(with, *came);
        if (!next) co_return next.error();
        came = *next;
    }
    const auto came_at = on.env().now();
    if (came->header.type == frame_type::reject) co_return farewell_of(with.peer(), *came);
    if (came->header.type != frame_type::welcome) co_return with.strange(*came);
    auto theirs = wire::read_body<wire::welcome>(came->body);
    if (!theirs) co_return theirs.error();
    if (key) { // nothing of the welcome counts before it
        auto proved = co_await proof_comes(with, false);
        if (!proved) co_return proved.error();
        if (!*proved) co_return did_not_prove(with.peer(), "it has another key, or it is an impostor");
    }
    if (theirs->version < mine.oldest || theirs->version > mine.newest)
        co_return failure(errc::version_mismatch, fmt::format("{} chose wire version {}, offered were {} to {}",
                                                              with.peer(), theirs->version, mine.oldest, mine.newest));
    if (auto other = somebody_else(mine, theirs->self))
        co_return failure(errc::wrong_peer, fmt::format("{} answered as {}", with.peer(), *other));
    session_terms terms;
    terms.version = theirs->version;
    terms.features = theirs->features & mine.features;
    if (terms.features & wire::feature::clock)
        terms.clock.note(with.sent_at(), time_point(duration(theirs->clock_ns)), came_at);
    terms.peer = session_peer(std::move(theirs->self));
    terms.peer.verified = with.verified(has_key);
    terms.we_accept = bounded(mine.accepts);
    terms.peer_accepts = with.fitting(bounded(theirs->accepts));
    co_return with.done(on, std::move(terms));
}

task<result<std::shared_ptr<connection>>> respond(loop& on, std::unique_ptr<stream> transport, gatekeeper& gate,
                                                  time_point deadline, const shared_key* key) {
    const bool has_key = key != nullptr;
    if (is_sealed(*transport)) key = nullptr; // it is proved before the first byte is read
    greeting with(on, std::move(transport), deadline, key, " (connect_time)");
    auto came = co_await with.receive();
    if (!came) co_return came.error();
    if (came->header.type != frame_type::hello) co_return with.strange(*came);
    auto theirs = wire::read_body<wire::hello>(came->body);
    if (!theirs) co_return failure(errc::protocol_error, fmt::format("{}: {}", with.peer(), theirs.error().message()));

    result<wire::welcome> answer = failure(errc::cancelled, "there is no answer");
    if (auto wrong = unspeakable(*theirs)) {
        answer = std::move(*wrong);
    } else {
        auto proved = co_await demand_proof(with, theirs->authentication);
        if (proved) gate.note(with.verified(has_key));
        answer = proved ? gate.admit(*theirs) : proved.error(); // whoever has no key learns nothing of who is here
    }
    if (!answer) {
        wire::farewell no;
        no.code = static_cast<std::uint8_t>(answer.error().code());
        no.reason = answer.error().message();
        auto outcome = co_await with.send(frame_type::reject, no);
        if (!outcome) co_return outcome.error();
        co_return failure(answer.error().code(),
                          fmt::format("{} was rejected: {}", with.peer(), answer.error().message()));
    }
    answer->version = std::min(wire::newest_version, theirs->newest);
    answer->features = with.fitting(answer->features) & theirs->features;
    answer->accepts = with.fitting(answer->accepts);
    answer->clock_ns = on.env().now().time_since_epoch().count();
    auto sent = co_await with.send(frame_type::welcome, *answer);
    if (!sent) co_return sent.error();
    if (key) {
        auto proof = with.keys().proof(false);
        auto shown = co_await with.send(frame_type::proof, proof);
        if (!shown) co_return shown.error();
    }
    session_terms terms;
    terms.version = answer->version;
    terms.features = answer->features;
    terms.peer = session_peer(std::move(theirs->self));
    terms.peer.reply_key = theirs->reply_key;
    terms.peer.verified = with.verified(has_key);
    terms.we_accept = bounded(answer->accepts);
    terms.peer_accepts = with.fitting(bounded(theirs->accepts));
    co_return with.done(on, std::move(terms));
}

} // namespace ise::net
