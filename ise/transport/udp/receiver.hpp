#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/interval_set.hpp>
#include <ise/core/time.hpp>
#include <ise/wire/datagram.hpp>

#include <map>
#include <optional>
#include <span>

namespace ise::net::udp {

/// Puts the peer's stream together, and remembers which datagrams came. Bounded: what is beyond a limit counts as
/// not received, and the peer sends it again. Without I/O.
class receiver {
public:
    static constexpr std::size_t first_window = 32 * 1024;
    static constexpr std::size_t max_window = 256 * 1024;
    /// Acks wait for company at most this long.
    static constexpr duration ack_delay = std::chrono::milliseconds(5);

    /// Whether a datagram of this number is to be looked at: not a duplicate, not too old to know, and one that an ack
    /// can name.
    bool fresh(std::uint64_t number) const noexcept {
        return number >= floor_ && ~number != 0 && !came_.contains(number);
    }
    void note(std::uint64_t number, bool wants_ack, time_point now);

    /// So much was read that the sender should know.
    bool room_grew() const noexcept { return room_grew_; }
    bool ack_pending() const noexcept { return pending_acks_ > 0 || room_grew_; }
    bool ack_due(time_point now) const noexcept { return ack_at_ <= now; }
    time_point ack_at() const noexcept { return ack_at_; }
    /// Puts an ack, and how much of the stream is taken.
    void put_ack(wire::data_writer& out, bool alone, time_point now);

    /// False where it breaks the limits: the datagram is to be forgotten.
    bool take_content(std::uint64_t offset, bytes_view content);
    bool take_end(std::uint64_t offset);

    std::size_t read(std::span<std::byte> into);
    bool readable() const noexcept { return upto_ > base_; }
    /// Of the stream, with the gaps in it.
    std::size_t bytes_held() const noexcept { return buffer_.size() - head_; }
    /// Everything was read, and nothing follows.
    bool ended() const noexcept { return end_ && base_ == *end_; }

private:
    // What lies there in order.
    bytes_view ready() const noexcept {
        return bytes_view(buffer_).subspan(head_, static_cast<std::size_t>(upto_ - base_));
    }
    void consume(std::size_t count);
    std::uint64_t room() const noexcept { return base_ + window_; }
    void put_runs(wire::data_writer& out, bool alone, time_point now) const;

    interval_set came_;
    std::uint64_t floor_ = 0;
    std::uint64_t largest_ = 0;
    time_point largest_at_{};
    unsigned pending_acks_ = 0;
    time_point ack_at_ = time_point::max();

    bytes buffer_; // from base_ on, with gaps
    std::size_t head_ = 0;
    std::uint64_t base_ = 0;
    std::uint64_t upto_ = 0; // in order
    interval_set got_;       // offsets beyond a gap
    std::uint64_t window_ = first_window;
    std::uint64_t told_room_ = first_window;
    bool room_grew_ = false;
    std::optional<std::uint64_t> end_;
};

/// Puts messages together from their fragments. Memory grows with what came, and is bounded; what does not get on
/// is dropped after a while.
class incoming_messages {
public:
    /// Unfinished ones at once, and their bytes together.
    static constexpr std::size_t max_unfinished = 32;
    static constexpr std::size_t max_bytes = 2 * wire::max_datagram_message_bytes;
    static constexpr duration patience = std::chrono::seconds(10);

    /// `done` has a message that is whole. False where the fragment is none.
    bool take(bytes_view content, time_point now, std::optional<bytes>& done);
    void drop_stale(time_point now);
    time_point due() const noexcept;

    std::size_t unfinished() const noexcept { return all_.size(); }
    std::size_t bytes_held() const noexcept { return held_; }
    std::uint64_t dropped() const noexcept { return dropped_; }

private:
    struct partial {
        std::uint32_t size = 0;
        std::size_t came = 0;
        time_point last{};
        std::map<std::uint32_t, bytes> fragments;
    };
    void drop(std::map<std::uint64_t, partial>::iterator which);

    std::map<std::uint64_t, partial> all_; // by number
    interval_set finished_;                // numbers; of these, and of those below floor_, nothing is taken again
    std::uint64_t floor_ = 0;
    std::size_t held_ = 0;
    std::uint64_t dropped_ = 0;
};

} // namespace ise::net::udp
