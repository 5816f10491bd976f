#pragma once
#include <components/communication_node/services.hpp>
#include <components/storage/database.hpp>

#include <span>

namespace atirma {

/// What a communication node must not lose, in one SQLite file: packets, telecommands, who has the authority, and how
/// far the other node's store is known. Packets are numbered 1, 2, 3… in the order in which they came to this disk, and
/// know their number at the other node. What a call returned success for is on the disk. Used by one component, on its
/// loop. Errors of everything: io_failed with what the disk says; nothing of that call is kept then.
class node_store {
public:
    /// `fresh_number` becomes the number of a file that is new; never 0.
    static ise::result<node_store> open(const std::string& file, std::uint64_t fresh_number);

    std::uint64_t number() const noexcept { return number_; }

    // Packets
    struct kept {
        std::uint64_t last = 0;    ///< the highest position among them, also of those that were known
        std::uint32_t fresh = 0;
    };
    ise::result<kept> add(std::span<const telemetry_packet> packets);
    std::uint64_t head() const noexcept { return head_; } ///< position of the newest
    ise::result<std::vector<telemetry_packet>> packets(std::uint64_t after, std::uint64_t up_to, std::size_t most);
    /// A page for somebody who knows what `request.seen` says; nothing beyond `up_to`.
    ise::result<track_page> track(const track_request& request, std::uint64_t up_to);
    /// Kind byte and time of the newest packet of each kind, no later than five minutes after its reception.
    ise::result<std::vector<std::pair<std::uint8_t, utc_time>>> newest();
    /// The newest packet of that kind that is not history.
    ise::result<std::optional<telemetry_packet>> last_of(std::uint8_t kind);

    // Telecommands
    ise::result<void> put(std::span<const command_record> records);
    std::uint64_t commands_head() const noexcept { return commands_head_; } ///< position of the last change
    ise::result<std::optional<command_record>> command(std::uint32_t id);
    ise::result<std::vector<command_record>> open_commands();
    ise::result<record_page> list(const record_request& request);

    // Authority
    ise::result<void> put(const authority_state& state, std::uint64_t change);
    ise::result<std::pair<authority_state, std::uint64_t>> authority();

    // The other node
    struct peer_position {
        std::uint64_t store = 0, packets = 0, commands = 0; ///< known of it
    };
    const peer_position& peer() const noexcept { return peer_; }
    /// What the other node, whose store is `asker`, is told that has everything up to those positions.
    ise::result<replication_page> page_after(std::uint64_t asker, std::uint64_t packets, std::uint64_t commands,
                                             std::size_t most);
    /// What the other node told, and which of its telecommands are news: all of it, or nothing. A page of a store that
    /// is not the known one begins anew. Gives how many packets were fresh. Errors: also malformed (a gap).
    ise::result<std::uint32_t> apply(const replication_page& page, std::span<const command_record> news,
                                     bool authority_is_news);

    /// Removes all but the newest packets and decided telecommands, a few thousand at a time; how many it were.
    ise::result<std::int64_t> prune(std::uint64_t keep_packets, std::uint64_t keep_commands);

private:
    node_store(database opened, std::uint64_t number) : db_(std::move(opened)), number_(number) {}
    ise::result<void> load();
    ise::result<std::uint64_t> insert(const telemetry_packet& packet, std::uint64_t peer_position, std::uint64_t& head,
                                      std::uint32_t& fresh);
    ise::result<void> write(const command_record& record, std::uint64_t position);
    ise::result<void> write(const authority_state& state, std::uint64_t change);
    telemetry_packet packet_of(const database_row& row) const;

    database db_;
    std::uint64_t number_;
    std::uint64_t head_ = 0, commands_head_ = 0;
    peer_position peer_;
};

} // namespace atirma
