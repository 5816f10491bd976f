#pragma once
#include <ise/packet/shared_bytes.hpp>
#include <ise/wire/datagram.hpp>
#include <ise/wire/frame.hpp>

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <set>
#include <vector>

namespace ise::net::udp {

/// A message is cut at multiples of this: with an ack beside it a fragment fills a datagram.
inline constexpr std::size_t fragment_bytes = 1024;

constexpr std::uint32_t fragments_of(std::size_t size) noexcept {
    return static_cast<std::uint32_t>((size + fragment_bytes - 1) / fragment_bytes);
}

/// A message that may be lost, while it is sent.
struct outgoing_message {
    std::uint64_t number = 0;
    std::uint64_t key = 0; ///< what it is the latest of: its subscription
    bytes head;            ///< frame header, and what stands before the payload
    shared_bytes payload;
    std::uint32_t next = 0;                      ///< the first fragment that was never sent
    std::uint32_t arrived = 0;                   ///< fragments that did
    std::set<std::uint32_t> again;               ///< fragments that were lost
    bool superseded = false;                     ///< there is a newer one of that key
    std::shared_ptr<outgoing_message> following; ///< the next of that key, until this one was sent: they leave in order

    std::size_t size() const noexcept { return head.size() + payload.size(); }
    std::uint32_t fragments() const noexcept { return fragments_of(size()); }
    void copy(std::size_t from, std::span<std::byte> into) const noexcept;
};

struct sent_fragment {
    std::shared_ptr<outgoing_message> of;
    std::uint32_t index = 0;
};

/// The messages of one channel that are to be sent, or whose arrival is not known. Each is sent once; the latest of
/// each key again until it has arrived, so that a value that does not change any more gets there in the end.
class outgoing_messages {
public:
    /// Whether one more should be asked for now: it is decided late, so that the latest value is the latest.
    bool wanted() const noexcept { return small_unsent_ < wire::datagram_bytes && big_ < 2; }
    void put(std::uint64_t key, const wire::frame_header& header, bytes_view head, const shared_bytes& payload);
    /// Drops those of that key.
    void forget(std::uint64_t key) noexcept;

    bool empty() const noexcept { return sending_.empty(); }
    /// Fragments for as much as there is room, in turns.
    void fill(wire::data_writer& out, std::vector<sent_fragment>& sent);
    void on_arrived(const sent_fragment& which);
    void on_lost(const sent_fragment& which);

    std::size_t waiting() const noexcept { return sending_.size(); }
    std::size_t unconfirmed() const noexcept { return latest_.size(); }

private:
    static constexpr std::size_t big_bytes = 16 * 1024;

    static std::size_t unsent(const outgoing_message& message) noexcept;
    void drop(const outgoing_message& message) noexcept;

    std::deque<std::shared_ptr<outgoing_message>> sending_; // in turns, and of each key at most one
    std::map<std::uint64_t, std::shared_ptr<outgoing_message>> latest_;
    std::uint64_t next_number_ = 0;
    std::size_t small_unsent_ = 0; // bytes of small messages
    std::size_t big_ = 0;          // of which not everything was sent once
};

} // namespace ise::net::udp
