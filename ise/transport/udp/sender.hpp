#pragma once
#include <ise/core/interval_set.hpp>
#include <ise/core/result.hpp>
#include <ise/core/ring.hpp>
#include <ise/transport/udp/congestion.hpp>
#include <ise/transport/udp/outgoing_messages.hpp>
#include <ise/transport/udp/receiver.hpp>

#include <algorithm>
#include <array>
#include <span>
#include <vector>

namespace ise::net::udp {

/// Which of our datagrams came, as the peer says: runs of numbers, the highest first.
struct acknowledgement {
    duration delayed{};
    std::vector<std::pair<std::uint64_t, std::uint64_t>> runs; ///< [begin, end)
    std::uint64_t largest() const noexcept { return runs.front().second - 1; }
};

/// What one side sends: a stream of bytes that arrives whole and in order, and messages that may be lost. It decides
/// what goes into the next datagram and when something has to be sent again; without I/O and without a clock.
class sender {
public:
    /// Bytes that are taken and were never sent; more would age here, behind the reach of priorities.
    static constexpr std::size_t max_unsent = 32 * 1024;

    std::size_t write(bytes_view content);
    bool writable() const noexcept { return !ended_ && unsent() < max_unsent; }
    void end() noexcept { ended_ = true; }
    bool ended() const noexcept { return ended_; }
    /// Whether everything, the end included, has arrived.
    bool finished() const noexcept { return ended_ && end_arrived_ && buffered() == 0; }
    /// Whether every byte that was written has arrived.
    bool settled() const noexcept { return buffered() == 0; }
    std::size_t unsent() const noexcept { return static_cast<std::size_t>(written() - next_); }

    outgoing_messages& messages() noexcept { return messages_; }
    const outgoing_messages& messages() const noexcept { return messages_; }

    /// Whether something may be put into a datagram now.
    bool ready(time_point now) noexcept;
    /// Whether there is something that the window or the pace may hold up.
    bool has_content() const noexcept;
    /// Puts what fits; true if the datagram wants an ack.
    bool fill(wire::data_writer& out);
    /// The datagram that was filled last has left.
    void on_sent(std::uint64_t number, std::size_t bytes, bool wants_ack, time_point now);

    /// After the largest number that the peer has acknowledged.
    std::uint64_t acked() const noexcept { return largest_acked_; }
    /// False where it names what was never sent.
    bool on_ack(const acknowledgement& what, time_point now);
    /// The peer takes bytes of the stream up to this offset.
    void on_room(std::uint64_t offset) noexcept { room_ = std::max(room_, offset); }

    time_point due(time_point now) noexcept;
    void on_timer(time_point now);

    /// As `congestion::limit`.
    void limit_under_way(std::size_t most) noexcept { network_.limit(most); }
    const congestion& network() const noexcept { return network_; }
    std::uint64_t lost() const noexcept { return lost_count_; }
    std::uint64_t time_outs() const noexcept { return time_outs_; }

private:
    struct record {
        std::uint64_t number = 0;
        time_point sent_at{};
        std::size_t bytes = 0;
        bool outstanding = false;
        bool ends = false;
        std::vector<std::pair<std::uint64_t, std::uint64_t>> content; // offsets [begin, end)
        std::vector<sent_fragment> fragments;
    };

    std::uint64_t written() const noexcept { return base_ + buffered(); }
    std::size_t buffered() const noexcept { return buffer_.size() - head_; }
    /// Whatever the peer says that it takes, no more is kept for it unconfirmed than a receiver has room for.
    std::uint64_t limit() const noexcept { return std::min({written(), room_, base_ + receiver::max_window}); }
    void put_content(wire::data_writer& out, std::uint64_t begin, std::uint64_t end);
    std::size_t reaching(std::uint64_t number) const noexcept;
    void on_arrived(record& which);
    void lose(record& which, bool congested);
    void find_lost(time_point now);
    void forget_old();
    bool end_waits() const noexcept { return ended_ && !end_sent_ && next_ == written(); }
    bool starved() const noexcept { return unsent() > 0 && next_ >= room_ && outstanding_ == 0; }
    time_point time_out_at() const noexcept;

    // The stream: bytes from base_ on, which is where the first byte stands that is not known to have arrived.
    bytes buffer_;
    std::size_t head_ = 0;
    std::uint64_t base_ = 0;
    std::uint64_t next_ = 0; // the first that was never sent
    std::uint64_t room_ = first_room;
    interval_set arrived_;
    interval_set again_;
    bool ended_ = false;
    bool end_sent_ = false;
    bool end_arrived_ = false;

    outgoing_messages messages_;
    congestion network_;
    record filling_;
    record spare_;         // empty, with room
    ring<record> records_; // by number
    std::size_t outstanding_ = 0;
    std::uint64_t next_number_ = 0;   // after the last that was sent
    std::uint64_t largest_acked_ = 0; // plus one
    time_point last_sent_{};          // something that wants an ack
    unsigned silences_ = 0;           // time-outs since something was heard
    unsigned probes_ = 0;             // datagrams that go beyond the window
    bool probe_wanted_ = false;
    bool messages_first_ = true;
    std::uint64_t lost_count_ = 0;
    std::uint64_t time_outs_ = 0;

public:
    /// What every receiver takes without having said so.
    static constexpr std::uint64_t first_room = 32 * 1024;
};

} // namespace ise::net::udp
