#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
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
/// Packet: the body carries the trace of its publication (`feature::packet_traces`).
inline constexpr std::uint8_t caused = 4;
inline constexpr std::uint8_t last = 1;      ///< piece: the message is complete
inline constexpr std::uint8_t abandoned = 2; ///< piece: the sender gave the message up
inline constexpr std::uint8_t stalled = 1;   ///< pong: the component is busy; its node answers for it
inline constexpr std::uint8_t objects = 1;   ///< subscribe: packets may come beside (`feature::objects`)
/// Request, reply, packet: the packet comes beside the stream (`feature::objects`); packet: the body ends with a
/// reference to shared memory that holds it (`feature::loans`).
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
    try {
        put_header(out, header);
        append(out);
    } catch (...) { // half a frame would end the session
        out.truncate(start);
        throw;
    }
    out.patch_u32(start, static_cast<std::uint32_t>(out.size() - start - frame_header::size));
}

/// What stands before the packet in the body of a request (FORMAT.md, "Calls"). The header's flags say what of it is
/// there.
struct request_head {
    std::uint32_t service = 0; ///< the number that the caller introduced it with
    std::int64_t time_ns = 0;  ///< what remains; if `until`, when it is over, by the receiver's clock
    bool until = false;        ///< only where both sides have `feature::clock`
    std::uint64_t trace = 0;   ///< its lower half; 0: none
    std::uint64_t parent = 0;  ///< in this trace
    std::uint64_t high = 0;    ///< the upper half of the trace; only where both sides have `feature::traces`
    std::uint64_t number = 0;  ///< outlives the session; 0: none

    /// The shortest one.
    static constexpr std::size_t min_size = 12;
    /// With these flags.
    static constexpr std::size_t size(std::uint8_t flags) noexcept {
        if (!(flags & (flag::traced | flag::numbered))) [[likely]]
            return min_size;
        const std::size_t of_trace = !(flags & flag::traced) ? 0 : flags & flag::wide ? 24 : 16;
        return min_size + of_trace + (flags & flag::numbered ? 8 : 0);
    }

    /// Of those flags that say what is there.
    std::uint8_t flags() const noexcept {
        const std::uint8_t of_time = until ? flag::until : std::uint8_t{0};
        if ((trace | number) == 0) [[likely]]
            return of_time;
        return static_cast<std::uint8_t>(of_time | (trace != 0 ? flag::traced : 0) |
                                         (trace != 0 && high != 0 ? flag::wide : 0) |
                                         (number != 0 ? flag::numbered : 0));
    }
    void put(buffer& out) const {
        std::byte* at = out.grow(size(flags()));
        detail::store_little(at, service);
        detail::store_little(at + 4, time_ns);
        at += min_size;
        if (trace != 0) {
            detail::store_little(at, trace);
            detail::store_little(at + 8, parent);
            at += 16;
            if (high != 0) {
                detail::store_little(at, high);
                at += 8;
            }
        }
        if (number != 0) detail::store_little(at, number);
    }
    /// Nothing where the body is too short for what its flags say.
    static std::optional<request_head> read(std::uint8_t flags, bytes_view body) noexcept {
        if (body.size() < size(flags)) return std::nullopt;
        request_head head;
        const auto* at = body.data();
        head.service = detail::load_little<std::uint32_t>(at);
        head.time_ns = detail::load_little<std::int64_t>(at + 4);
        head.until = flags & flag::until;
        at += min_size;
        if (flags & flag::traced) {
            head.trace = detail::load_little<std::uint64_t>(at);
            head.parent = detail::load_little<std::uint64_t>(at + 8);
            at += 16;
            if (flags & flag::wide) {
                head.high = detail::load_little<std::uint64_t>(at);
                at += 8;
            }
        }
        if (flags & flag::numbered) head.number = detail::load_little<std::uint64_t>(at);
        return head;
    }
};

} // namespace ise::wire
