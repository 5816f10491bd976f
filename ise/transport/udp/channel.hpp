#pragma once
#include <ise/transport/udp/receiver.hpp>
#include <ise/transport/udp/sender.hpp>

namespace ise::net::udp {

/// One conversation over datagrams, once both sides know each other's ids: a reliable stream of bytes and messages
/// that may be lost, each way. It reads and writes datagrams, and says when it wants to be asked again; without I/O.
class channel {
public:
    /// What a datagram brought besides bytes of the stream.
    struct events {
        std::vector<bytes> messages;            ///< whole
        std::optional<std::uint64_t> challenge; ///< to be sent back to where it came from
        std::optional<std::uint64_t> response;  ///< to a challenge of ours
        bool closed = false;                    ///< the peer has left
    };

    /// `peer_id`: how the peer wants to be addressed. `seal_bytes`: room for a seal before the chunks of a datagram.
    explicit channel(std::uint64_t peer_id, std::size_t seal_bytes = 0) : peer_id_(peer_id), seal_bytes_(seal_bytes) {}

    /// Takes the body of a data datagram. False where it counts as not received: a duplicate, or one that breaks a
    /// rule. What stood before that in it is taken, and comes again.
    bool take(bytes_view body, time_point now, events& happened);
    /// Whether its number is one that was not seen.
    bool fresh(bytes_view body) const noexcept;

    /// Whether there is something that `next` may send, or may have to wait with.
    bool wanting(time_point now) const noexcept {
        return sender_.has_content() || (receiver_.ack_pending() && receiver_.ack_due(now));
    }
    /// Writes the next datagram; false: nothing is to be sent now.
    bool next(buffer& out, time_point now);
    /// When `next` or `on_timer` should be called again.
    time_point due(time_point now) noexcept;
    void on_timer(time_point now);

    /// A datagram with just a challenge or a response, for an address that is not (yet) the peer's.
    void put_probe(buffer& out, wire::chunk_type type, std::uint64_t value);

    sender& out() noexcept { return sender_; }
    const sender& out() const noexcept { return sender_; }
    receiver& in() noexcept { return receiver_; }
    const receiver& in() const noexcept { return receiver_; }
    std::uint64_t peer_id() const noexcept { return peer_id_; }
    /// From now on its datagrams have no room for a seal.
    void stay_plain() noexcept { seal_bytes_ = 0; }
    /// Messages are taken from now on: the other side has shown who it is.
    void take_messages() noexcept { messages_taken_ = true; }
    const incoming_messages& messages() const noexcept { return messages_; }
    /// What has come and waits for more of it, or to be read.
    std::size_t bytes_held() const noexcept { return receiver_.bytes_held() + messages_.bytes_held(); }
    std::uint64_t ignored() const noexcept { return ignored_; }

private:
    bool take_chunks(wire::chunk_reader& chunks, time_point now, events& happened, bool& wants_ack);

    std::uint64_t peer_id_;
    std::size_t seal_bytes_;
    std::uint64_t next_number_ = 0;
    sender sender_;
    receiver receiver_;
    acknowledgement heard_; // keeps its room
    incoming_messages messages_;
    bool messages_taken_ = false;
    std::uint64_t ignored_ = 0;
};

} // namespace ise::net::udp
