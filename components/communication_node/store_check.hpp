#pragma once
#include <components/communication_node/sqlite_store.hpp>

namespace atirma {

/// Reads the file of a node's store as far as it can be read, also a damaged one, and never writes to it.
class store_reader {
public:
    /// Errors: io_failed; malformed where nothing of it can be read, or it is no store of a communication node.
    static ise::result<store_reader> open(const std::string& file);

    std::uint64_t schema() const noexcept { return schema_; }
    /// The next packets in the order of their positions, at most so many; empty at the end. Damaged ones are left out
    /// and counted; what the file cannot give at all is stepped over.
    std::vector<telemetry_packet> next_packets(std::size_t most);
    /// The same of telecommands, in the order in which they were recorded.
    std::vector<command_record> next_commands(std::size_t most);
    /// The newest change of the authority that is sound, and its number.
    std::pair<authority_state, std::uint64_t> authority();

    /// What was found until now.
    struct findings {
        std::uint64_t packets = 0, telecommands = 0;                 ///< sound
        std::uint64_t unsealed = 0;                                  ///< of the packets: written without a checksum
        std::uint64_t damaged_packets = 0, damaged_telecommands = 0; ///< they differ from their checksums
        std::vector<std::uint64_t> damaged_positions;                ///< the first 20 of the packets
        std::vector<std::string> unreadable;                         ///< what SQLite said of the file, the first 20
    };
    const findings& found() const noexcept { return found_; }
    /// Looks at everything else of the file as well: its structure and the small tables.
    void check_the_rest();

private:
    store_reader(ise::database opened, std::uint64_t schema) : db_(std::move(opened)), schema_(schema) {}
    std::vector<ise::database_row> next_rows(std::string_view sql, std::int64_t& after, std::size_t most,
                                             std::size_t place);
    void unreadable(std::string why);

    ise::database db_;
    std::uint64_t schema_;
    std::int64_t last_packet_ = 0, last_command_ = 0; ///< read, or stepped over
    findings found_;
};

/// All of that file in words, for people, and whether it is sound. Errors: as of `store_reader::open`.
struct store_verdict {
    bool sound = false;
    std::string text;
};
ise::result<store_verdict> check_store(const std::string& file);

} // namespace atirma
