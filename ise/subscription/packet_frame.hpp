#pragma once
#include <ise/core/time.hpp>
#include <ise/wire/frame.hpp>

#include <cstdint>

/// A published packet as the frame that it travels in: header, sequence, time of publication, packet.
namespace ise::packet_frame {

/// What stands before the packet.
inline constexpr std::size_t head_bytes = wire::frame_header::size + 16;

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
