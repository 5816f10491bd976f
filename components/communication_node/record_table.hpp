#pragma once
#include <components/communication_node/services.hpp>

#include <ise/database/database.hpp>

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace atirma {

/// The telecommands, and the changes of the authority, in the file of a node's store. All functions throw ise::error:
/// io_failed; malformed for a row that differs from its checksum, or is not readable.
class record_table {
public:
    explicit record_table(ise::database& in) : db_(&in) {}

    void put(const command_record& record, std::uint64_t position);
    std::optional<command_record> find(std::uint32_t id);
    std::vector<command_record> open();
    /// The last state of those that changed after that position, and the position of the last of them.
    std::pair<std::vector<command_record>, std::uint64_t> changed(std::uint64_t after, std::size_t most);
    record_page list(const record_request& request);
    std::int64_t prune(std::uint64_t keep); ///< decided ones, a few thousand at a time; how many

    void put(const authority_state& state, std::uint64_t change);
    std::pair<authority_state, std::uint64_t> authority(); ///< the newest, and its number within the epoch

private:
    std::vector<command_record> records_in(const std::vector<ise::database_row>& rows) const;

    ise::database* db_;
};

} // namespace atirma
