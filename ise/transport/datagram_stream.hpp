#pragma once
#include <ise/core/stream.hpp>
#include <ise/transport/packet_lane.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>

namespace ise::net {

/// A stream that lies in datagrams: beside its bytes, which arrive whole and in order, it carries messages that may be
/// lost, and may overtake and be overtaken. A message is one whole frame.
class datagram_stream : public stream, public packet_lane {
public:
    class user {
    public:
        /// Something came, be it only an ack: the peer is there.
        virtual void on_heard() = 0;
        /// A message came: header and body of a frame. Called inside a turn of the loop.
        virtual void on_message(bytes_view message) = 0;
        /// The peer is there, but busy: its node says so.
        virtual void on_sign() = 0;
        /// A message may be put again after `wanted()` was false.
        virtual void on_room() = 0;

    protected:
        ~user() = default;
    };

    /// From now on `receiver` gets the messages. What comes of the stream goes to the reader of `deliver_to`, if there
    /// is one: what is there already within this call, and `read_some` only completes with the end. Called inside a
    /// turn.
    virtual void use(std::weak_ptr<user> receiver) = 0;
    /// Tells the peer that this side is there, but busy. From any thread, while the stream is open; false: not now.
    virtual bool show_sign() noexcept = 0;
    /// Of messages, and of the stream, which have come in part or are not taken yet.
    virtual std::size_t bytes_held() const noexcept = 0;
    /// The most that one message or call may have.
    virtual std::uint64_t max_message_bytes() const noexcept = 0;
};

} // namespace ise::net
