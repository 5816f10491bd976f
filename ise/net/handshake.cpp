#include <ise/net/handshake.hpp>

#include <ise/core/limits.hpp>
#include <ise/packet/codec.hpp>
#include <ise/wire/body.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::net {
namespace {

using wire::frame_type;

constexpr std::uint64_t shortest_heartbeat_ns = 20'000'000;
constexpr std::uint64_t longest_heartbeat_ns = 3'600'000'000'000;
constexpr std::uint64_t largest_message_bytes = 0xffff'0000; // a frame's header counts in 32 bits

wire::limits bounded(wire::limits offered) {
    offered.heartbeat_ns = std::clamp(offered.heartbeat_ns, shortest_heartbeat_ns, longest_heartbeat_ns);
    offered.max_frame_bytes = std::max(offered.max_frame_bytes, wire::smallest_frame_limit);
    offered.max_message_bytes = std::min(offered.max_message_bytes, largest_message_bytes);
    return offered;
}

// A stream during the handshake: closed at the deadline, so that whoever waits on it goes on.
class greeting {
public:
    greeting(loop& on, std::unique_ptr<stream> transport, time_point deadline)
        : transport_(std::move(transport)), parser_(limit::greeting_bytes), alarm_(on, [this] {
              late_ = true;
              transport_->close();
          }) {
        alarm_.arm(deadline);
    }

    task<result<wire::frame>> receive() {
        for (;;) {
            auto found = parser_.next();
            if (!found) co_return found.error();
            if (*found) co_return **found;
            auto room = parser_.prepare();
            auto got = co_await transport_->read_some(asio::buffer(room.data(), room.size()));
            if (got.problem) co_return broken(got.problem);
            parser_.commit(got.bytes);
        }
    }

    template <class Body>
    task<result<void>> send(frame_type type, const Body& body) {
        buffer out;
        wire::put_frame(out, type, 0, 0, [&](buffer& to) { encode(body, to); });
        return send(std::move(out));
    }

    task<result<void>> send(buffer out) {
        for (std::size_t sent = 0; sent < out.size();) {
            asio::const_buffer rest(out.data() + sent, out.size() - sent);
            auto wrote = transport_->try_write(std::span(&rest, 1));
            sent += wrote.bytes;
            if (wrote.problem == asio::error::would_block) wrote.problem = co_await transport_->wait_writable();
            if (wrote.problem) co_return broken(wrote.problem);
        }
        co_return result<void>();
    }

    /// What the transport carries sets a limit of its own.
    wire::limits fitting(wire::limits offered) const {
        if (auto* datagrams = dynamic_cast<datagram_stream*>(transport_.get()))
            offered.max_message_bytes = std::min(offered.max_message_bytes, datagrams->max_message_bytes());
        return offered;
    }

    std::string peer() const { return transport_->peer(); }
    failure strange(const wire::frame& came) const {
        return {errc::protocol_error, fmt::format("{} sent '{}' instead of a greeting", peer(), wire::name_of(came.header.type))};
    }
    std::shared_ptr<connection> done(loop& on, session_terms terms) {
        alarm_.disarm();
        return std::make_shared<connection>(on, std::move(transport_), std::move(terms), std::move(parser_));
    }

private:
    failure broken(const std::error_code& problem) const {
        if (late_) return {errc::timed_out, fmt::format("{} did not greet in time", peer())};
        if (problem == asio::error::operation_aborted) return {errc::cancelled, "the handshake was cancelled"};
        std::string why = problem == asio::error::eof ? "closed the connection during the handshake" : problem.message();
        return {errc::peer_lost, fmt::format("{}: {}", peer(), why)};
    }

    std::unique_ptr<stream> transport_;
    wire::parser parser_;
    timer alarm_;
    bool late_ = false;
};

failure farewell_of(const std::string& peer, const wire::frame& came) {
    auto why = wire::read_body<wire::farewell>(came.body);
    if (!why) return {errc::protocol_error, fmt::format("{} rejected the session with an unreadable reason", peer)};
    return {static_cast<errc>(why->code), fmt::format("{} rejected the session: {}", peer, why->reason)};
}

} // namespace

task<result<std::shared_ptr<connection>>> initiate(loop& on, std::unique_ptr<stream> transport, wire::hello mine, time_point deadline) {
    greeting with(on, std::move(transport), deadline);
    mine.accepts = with.fitting(mine.accepts);
    auto sent = co_await with.send(frame_type::hello, mine);
    if (!sent) co_return sent.error();
    auto came = co_await with.receive();
    if (!came) co_return came.error();
    if (came->header.type == frame_type::reject) co_return farewell_of(with.peer(), *came);
    if (came->header.type != frame_type::welcome) co_return with.strange(*came);
    auto theirs = wire::read_body<wire::welcome>(came->body);
    if (!theirs) co_return theirs.error();
    if (theirs->version < mine.oldest || theirs->version > mine.newest)
        co_return failure(errc::version_mismatch, fmt::format("{} chose wire version {}, offered were {} to {}", with.peer(),
                                                              theirs->version, mine.oldest, mine.newest));
    session_terms terms;
    terms.version = theirs->version;
    terms.features = theirs->features & mine.features;
    terms.peer = session_peer(std::move(theirs->self));
    terms.we_accept = bounded(mine.accepts);
    terms.peer_accepts = with.fitting(bounded(theirs->accepts));
    co_return with.done(on, std::move(terms));
}

task<result<std::shared_ptr<connection>>> respond(loop& on, std::unique_ptr<stream> transport, gatekeeper& gate, time_point deadline) {
    greeting with(on, std::move(transport), deadline);
    auto came = co_await with.receive();
    if (!came) co_return came.error();
    if (came->header.type != frame_type::hello) co_return with.strange(*came);
    auto theirs = wire::read_body<wire::hello>(came->body);
    if (!theirs) co_return failure(errc::protocol_error, fmt::format("{}: {}", with.peer(), theirs.error().message()));

    result<wire::welcome> answer = failure(errc::protocol_error, "the hello does not begin with ISE's mark");
    if (theirs->magic == wire::magic) {
        if (theirs->oldest > wire::newest_version || theirs->newest < wire::oldest_version) {
            answer = failure(errc::version_mismatch, fmt::format("wire versions {} to {} are spoken here, {} to {} were offered",
                                                                 wire::oldest_version, wire::newest_version, theirs->oldest, theirs->newest));
        } else {
            answer = gate.admit(*theirs);
        }
    }
    if (!answer) {
        wire::farewell no;
        no.code = static_cast<std::uint8_t>(answer.error().code());
        no.reason = answer.error().message();
        auto told = co_await with.send(frame_type::reject, no);
        if (!told) co_return told.error();
        co_return failure(answer.error().code(), fmt::format("{} was rejected: {}", with.peer(), answer.error().message()));
    }
    answer->version = std::min(wire::newest_version, theirs->newest);
    answer->features &= theirs->features;
    answer->accepts = with.fitting(answer->accepts);
    auto sent = co_await with.send(frame_type::welcome, *answer);
    if (!sent) co_return sent.error();
    session_terms terms;
    terms.version = answer->version;
    terms.features = answer->features;
    terms.peer = session_peer(std::move(theirs->self));
    terms.we_accept = bounded(answer->accepts);
    terms.peer_accepts = with.fitting(bounded(theirs->accepts));
    co_return with.done(on, std::move(terms));
}

} // namespace ise::net
