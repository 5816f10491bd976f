#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/ring.hpp>
#include <ise/core/time.hpp>
#include <ise/core/trace_id.hpp>
#include <ise/session/carried_packet.hpp>
#include <ise/subscription/packet_frame.hpp>
#include <ise/subscription/received.hpp>

#include <cstdint>

namespace ise {

/// The trace of a packet, and when it came.
struct traced_arrival {
    trace_id trace;
    time_point came{};
};

/// The published packets that a subscriber has not taken yet, encoded, as frames one behind the other in one buffer:
/// what is dropped was never decoded, and a burst costs one copy and no allocation. Those that came as objects stand in
/// the same line. Each knows how many packets were lost before it, and when it was published, and a few their traces.
class receive_queue {
public:
    bool empty() const noexcept { return count_ == 0; }
    std::size_t size() const noexcept { return count_; }
    /// Of the frames; objects are their provider's, in this process.
    std::size_t bytes() const noexcept { return content_.size() - begin_; }

    void push(passed_object packet, const packet_origin& from, const traced_arrival* traced = nullptr) {
        objects_.push_back(std::move(packet));
        push({}, from, object_mark, traced);
    }
    void push(bytes_view packet, const packet_origin& from, const traced_arrival* traced = nullptr) {
        push(packet, from, 0, traced);
    }

    /// So many frames as they came (`packet_frame`, without traces), none of which was lost before them.
    void push_run(bytes_view frames, std::size_t packets) {
        std::memcpy(grow(frames.size()), frames.data(), frames.size());
        count_ += packets;
    }

    /// The oldest; only where there is one. Valid until the next push or pop; a shared object may be taken out of it.
    incoming_packet front() noexcept {
        if (front_marks() & object_mark) return {{}, &objects_.front()};
        return {front_bytes(), nullptr};
    }
    /// The same where none comes as an object.
    bytes_view front_bytes() const noexcept {
        return {front_frame() + packet_frame::head_bytes, front_size() - packet_frame::head_bytes};
    }
    /// Of the oldest, if it belongs to a trace; only where there is one.
    const traced_arrival* front_trace() const noexcept {
        return front_marks() & traced_mark ? &traces_.front() : nullptr;
    }
    /// Removes the oldest, and gives what was known of it.
    packet_origin pop() noexcept {
        packet_origin from;
        from.published_at = packet_frame::published_at(front_frame());
        if (front_marks() != as_it_came) [[unlikely]]
            from.lost_before = pop_marked();
        begin_ += front_size();
        if (--count_ == 0) drained();
        return from;
    }

private:
    // Marks take the place of the frame's flags. Except in a frame `as_it_came`, the number of lost packets takes the
    // place of its id.
    static constexpr std::uint8_t as_it_came = wire::flag::stamped;
    static constexpr std::uint8_t marked = 16, object_mark = 32, traced_mark = 64;

    void push(bytes_view packet, const packet_origin& from, std::uint8_t marks, const traced_arrival* traced) {
        if (traced) [[unlikely]] {
            traces_.push_back(*traced);
            marks |= traced_mark;
        }
        const std::size_t size = packet_frame::head_bytes + packet.size();
        std::byte* at = grow(size);
        packet_frame::complete(at, size, from.lost_before, 0, from.published_at);
        at[5] = static_cast<std::byte>(marks | marked);
        if (!packet.empty()) std::memcpy(at + packet_frame::head_bytes, packet.data(), packet.size());
        ++count_;
    }
    std::byte* grow(std::size_t size) {
        if (content_.capacity() - content_.size() < size) [[unlikely]]
            make_room(size);
        return content_.grow(size);
    }
    const std::byte* front_frame() const noexcept { return content_.data() + begin_; }
    std::uint8_t front_marks() const noexcept { return static_cast<std::uint8_t>(front_frame()[5]); }
    std::size_t front_size() const noexcept { return packet_frame::size_of(front_frame()); }

    static constexpr std::size_t kept_bytes = 4 * 1024; // of an empty queue, at least
    static constexpr unsigned little_before_freed = 16;
    void make_room(std::size_t more);
    std::uint64_t pop_marked() noexcept;
    void drained() noexcept;

    buffer content_;
    ring<passed_object> objects_;
    ring<traced_arrival> traces_;
    std::size_t begin_ = 0;
    std::size_t count_ = 0;
    unsigned little_ = 0; // so many times in a row there was little
};

} // namespace ise
