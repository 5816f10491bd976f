#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace ise::wire {

/// The kinds of frame (FORMAT.md, "Frames"). The numbers are never reused.
enum class frame_type : std::uint8_t {
    hello = 1,
    welcome = 2,
    reject = 3,
    challenge = 11, ///< of a responder that demands a shared key
    proof = 12,     ///< that a side knows it

    request = 16,
    reply = 17,
    error = 18,
    cancel = 19,
    introduce = 20, ///< a service's number and packets, by its caller; before the first request of that number
    answers = 21,   ///< the packets of the provider, where they differ; before the first reply of that number

    subscribe = 32,
    subscribed = 33,
    packet = 34,
    unsubscribe = 35,
    unsubscribed = 36,
    ended = 37,
    credit = 38,

    ping = 48,
    pong = 49,
    goodbye = 50,

    piece = 64,
    schema_request = 72,
    schema = 73,
};

std::string_view name_of(frame_type type) noexcept;

/// Bits of `frame_header::flags`; what a bit means depends on the type.
namespace flag {
inline constexpr std::uint8_t traced = 1;   ///< request: the body carries a trace
inline constexpr std::uint8_t numbered = 2; ///< request: the body carries a number that outlives the session
inline constexpr std::uint8_t again = 4;    ///< request: it may have been sent before, by that number
inline constexpr std::uint8_t until = 8;    ///< request: its time is one of the provider's clock (`feature::clock`)
inline constexpr std::uint8_t wide = 16;    ///< request: of a trace of 128 bits the upper half, too (`feature::traces`)
inline constexpr std::uint8_t skipped = 1;  ///< packet: the body carries a count of packets skipped by rate limit
inline constexpr std::uint8_t stamped = 2;  ///< packet: the body carries its time of publication (`feature::stamps`)
inline constexpr std::uint8_t last = 1;     ///< piece: the message is complete
inline constexpr std::uint8_t abandoned = 2; ///< piece: the sender gave the message up
inline constexpr std::uint8_t stalled = 1;   ///< pong: the component is busy; its node answers for it
inline constexpr std::uint8_t objects = 1;   ///< subscribe: packets may come beside (`feature::objects`)
/// Request, reply, packet: the packet comes beside the stream (`feature::objects`).
inline constexpr std::uint8_t attached = 128;
} // namespace flag

/// Stands before every body: 16 bytes, little-endian.
struct frame_header {
    std::uint32_t length = 0; ///< of the body, in bytes
    frame_type type{};
    std::uint8_t flags = 0;
    std::uint16_t reserved = 0; ///< zero; what it will mean is negotiated
    std::uint64_t id = 0;       ///< of the call, subscription, message in pieces, ping: see the type

    static constexpr std::size_t size = 16;
};

inline void store_header(std::byte* at, const frame_header& header) noexcept {
    detail::store_little(at, header.length);
    detail::store_little(at + 4, static_cast<std::uint8_t>(header.type));
    detail::store_little(at + 5, header.flags);
    detail::store_little(at + 6, header.reserved);
    detail::store_little(at + 8, header.id);
}

inline void put_header(buffer& out, const frame_header& header) { store_header(out.grow(frame_header::size), header); }

inline frame_header read_header(const std::byte* from) noexcept {
    frame_header header;
    header.length = detail::load_little<std::uint32_t>(from);
    header.type = static_cast<frame_type>(detail::load_little<std::uint8_t>(from + 4));
    header.flags = detail::load_little<std::uint8_t>(from + 5);
    header.reserved = detail::load_little<std::uint16_t>(from + 6);
    header.id = detail::load_little<std::uint64_t>(from + 8);
    return header;
}

/// A frame as it lies in a parser's buffer.
struct frame {
    frame_header header;
    bytes_view body;
};

/// Writes a frame whose body is what `append` appends to the buffer.
template <class Append>
void put_frame(buffer& out, frame_type type, std::uint8_t flags, std::uint64_t id, Append&& append) {
    frame_header header;
    header.type = type;
    header.flags = flags;
    header.id = id;
    std::size_t start = out.size();
    put_header(out, header);
    append(out);
    out.patch_u32(start, static_cast<std::uint32_t>(out.size() - start - frame_header::size));
}

} // namespace ise::wire
