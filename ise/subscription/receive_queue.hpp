#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/ring.hpp>
#include <ise/core/time.hpp>
#include <ise/core/trace_id.hpp>
#include <ise/session/carried_packet.hpp>
#include <ise/subscription/received.hpp>

#include <cstdint>

namespace ise {

/// The trace of a packet, and when it came.
struct traced_arrival {
    trace_id trace;
    time_point came{};
};

/// The published packets that a subscriber has not taken yet, encoded, one behind the other in one buffer: what is
/// dropped was never decoded, and a burst costs a copy a packet and no allocation. Those that came as objects stand in
/// the same line. Each knows how many packets were lost before it, and when it was published, and a few their traces.
class receive_queue {
public:
    bool empty() const noexcept { return count_ == 0; }
    std::size_t size() const noexcept { return count_; }

    void push(passed_object packet, const packet_origin& from, const traced_arrival* traced = nullptr) {
        objects_.push_back(std::move(packet));
        push({}, from, object_mark, traced);
    }
    void push(bytes_view packet, const packet_origin& from, const traced_arrival* traced = nullptr) {
        push(packet, from, 0, traced);
    }

    /// The oldest; only where there is one. Valid until the next push or pop; a shared object may be taken out of it.
    incoming_packet front() noexcept {
        if (front_word() & object_mark) return {{}, &objects_.front()};
        return {{content_.data() + begin_ + head_bytes, front_size()}, nullptr};
    }
    /// Of the oldest, if it belongs to a trace; only where there is one.
    const traced_arrival* front_trace() const noexcept {
        return front_word() & traced_mark ? &traces_.front() : nullptr;
    }
    /// Removes the oldest, and gives what was known of it.
    packet_origin pop() noexcept {
        packet_origin from;
        from.lost_before = detail::load_little<std::uint64_t>(content_.data() + begin_);
        from.published_at = wall_time(duration(detail::load_little<std::int64_t>(content_.data() + begin_ + 16)));
        if (front_word() & object_mark) auto gone = objects_.pop_front();
        if (front_word() & traced_mark) [[unlikely]]
            traces_.pop_front();
        begin_ += head_bytes + front_size();
        if (--count_ > 0) return from;
        // A burst's room is given back when the queue has been emptied some times in a row with little in it.
        if (content_.capacity() <= kept_bytes || begin_ >= content_.capacity() / 16) little_ = 0;
        else if (++little_ == little_before_freed) content_ = buffer();
        content_.clear();
        begin_ = 0;
        return from;
    }

private:
    void push(bytes_view packet, const packet_origin& from, std::uint64_t mark, const traced_arrival* traced) {
        if (traced) [[unlikely]] {
            traces_.push_back(*traced);
            mark |= traced_mark;
        }
        const std::size_t size = head_bytes + packet.size();
        if (content_.capacity() - content_.size() < size) [[unlikely]]
            make_room(size);
        std::byte* at = content_.grow(size);
        detail::store_little(at, from.lost_before);
        detail::store_little(at + 8, packet.size() | mark);
        detail::store_little(at + 16, static_cast<std::int64_t>(from.published_at.time_since_epoch().count()));
        if (!packet.empty()) std::memcpy(at + head_bytes, packet.data(), packet.size());
        ++count_;
    }

    static constexpr std::size_t head_bytes = 24;
    static constexpr std::size_t kept_bytes = 4 * 1024; // of an empty queue, at least
    static constexpr unsigned little_before_freed = 16;
    static constexpr std::uint64_t object_mark = std::uint64_t{1} << 63;
    static constexpr std::uint64_t traced_mark = std::uint64_t{1} << 62;
    std::uint64_t front_word() const noexcept {
        return detail::load_little<std::uint64_t>(content_.data() + begin_ + 8);
    }
    std::size_t front_size() const noexcept {
        return static_cast<std::size_t>(front_word() & ~(object_mark | traced_mark));
    }
    void make_room(std::size_t more);

    buffer content_;
    ring<passed_object> objects_;
    ring<traced_arrival> traces_;
    std::size_t begin_ = 0;
    std::size_t count_ = 0;
    unsigned little_ = 0; // so many times in a row there was little
};

} // namespace ise
