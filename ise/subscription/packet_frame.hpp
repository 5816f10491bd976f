#pragma once
#include <ise/core/time.hpp>
#include <ise/core/trace_id.hpp>
#include <ise/wire/frame.hpp>

#include <cstdint>

/// A published packet as the frame that it travels in: header, sequence, time of publication, its trace if it has one,
/// packet.
namespace ise::packet_frame {

/// The size of the head before a packet without a trace.
inline constexpr std::size_t head_bytes = wire::frame_header::size + 16;
inline constexpr std::size_t trace_bytes = 24;

/// The size of the head before a packet of this trace, or of none.
inline std::size_t head_size(const trace_id& trace) noexcept { return trace ? head_bytes + trace_bytes : head_bytes; }

inline void put_trace(std::byte* at, const trace_id& trace) noexcept {
    detail::store_little(at, trace.trace);
    detail::store_little(at + 8, trace.parent);
    detail::store_little(at + 16, trace.high);
}
inline trace_id read_trace(const std::byte* at) noexcept {
    trace_id made;
    made.trace = detail::load_little<std::uint64_t>(at);
    made.parent = detail::load_little<std::uint64_t>(at + 8);
    made.high = detail::load_little<std::uint64_t>(at + 16);
    return made;
}

/// Completes a frame of `size` bytes; `id` is a subscription's.
inline void complete(std::byte* frame, std::size_t size, std::uint64_t id, std::uint64_t sequence,
                     wall_time published_at) noexcept {
    wire::frame_header header;
    header.type = wire::frame_type::packet;
    header.flags = wire::flag::stamped;
    header.length = static_cast<std::uint32_t>(size - wire::frame_header::size);
    header.id = id;
    wire::store_header(frame, header);
    detail::store_little(frame + wire::frame_header::size, sequence);
    detail::store_little(frame + wire::frame_header::size + 8,
                         static_cast<std::int64_t>(published_at.time_since_epoch().count()));
}

/// The same with its trace, if it has one: it was given the room for that.
inline void complete(std::byte* frame, std::size_t size, std::uint64_t id, std::uint64_t sequence,
                     wall_time published_at, const trace_id& trace) noexcept {
    complete(frame, size, id, sequence, published_at);
    if (!trace) return;
    frame[5] = static_cast<std::byte>(wire::flag::stamped | wire::flag::caused);
    put_trace(frame + head_bytes, trace);
}

inline bool has_trace(const std::byte* frame) noexcept {
    return static_cast<std::uint8_t>(frame[5]) & wire::flag::caused;
}
inline trace_id trace_of(const std::byte* frame) noexcept {
    return has_trace(frame) ? read_trace(frame + head_bytes) : trace_id();
}
/// The size of the head before the packet.
inline std::size_t head_size(const std::byte* frame) noexcept {
    return has_trace(frame) ? head_bytes + trace_bytes : head_bytes;
}
inline std::size_t size_of(const std::byte* frame) noexcept {
    return wire::frame_header::size + detail::load_little<std::uint32_t>(frame);
}
inline std::uint64_t id_of(const std::byte* frame) noexcept { return detail::load_little<std::uint64_t>(frame + 8); }
inline std::uint64_t sequence_of(const std::byte* frame) noexcept {
    return detail::load_little<std::uint64_t>(frame + wire::frame_header::size);
}
inline wall_time published_at(const std::byte* frame) noexcept {
    return wall_time(duration(detail::load_little<std::int64_t>(frame + wire::frame_header::size + 8)));
}

} // namespace ise::packet_frame
