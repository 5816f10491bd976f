#pragma once
#include <components/boat/communication.hpp>

#include <ise/database/database.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace atirma {

/// The packets in the file of a node's store. All functions throw ise::error: io_failed; malformed for a row that
/// differs from its checksum.
class packet_table {
public:
    explicit packet_table(ise::database& in) : db_(&in) {}

    struct place {
        std::uint64_t position = 0;
        bool fresh = false;
    };
    /// Puts it at that position, unless it is known with the same content: then it keeps its place. `at_peer`: its
    /// position at the other node; 0: unknown.
    place put(const telemetry_packet& packet, std::uint64_t position, std::uint64_t at_peer);
    void note_at_peer(std::uint64_t position, std::uint64_t at_peer); ///< nothing if it was pruned meanwhile
    void forget_at_peer(std::uint64_t after);

    /// In the order of their positions, at most so many, without the numbers of the stores.
    std::vector<telemetry_packet> page(std::uint64_t after, std::uint64_t up_to, std::size_t most);
    /// Of these, those that are not up to `at_peer` at the other node, and that were measured in the request's time.
    std::vector<telemetry_packet> page(std::uint64_t after, std::uint64_t up_to, std::uint64_t at_peer,
                                       const track_request& request, std::size_t most);
    std::vector<std::pair<std::uint8_t, utc_time>> newest(); ///< see node_store
    std::optional<telemetry_packet> last_location();

    std::int64_t prune(std::uint64_t up_to); ///< a few thousand at a time; how many
    std::int64_t seal();

private:
    std::vector<telemetry_packet> select(std::string_view sql, ise::database::values bound);
    [[noreturn]] void damaged(std::uint64_t position) const;

    ise::database* db_;
};

} // namespace atirma
