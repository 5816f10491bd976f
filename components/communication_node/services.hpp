#pragma once
#include <components/boat/communication.hpp>

// What two communication nodes tell each other. Everybody else uses components/boat/communication.hpp.
namespace atirma {

/// A telecommand with what a node needs to go on with it.
struct command_record {
    telecommand_status status;
    utc_time valid_until{};
    std::optional<link_id> via;
    std::string node;                    ///< which one gives it to the links
    std::int64_t asked_steady_ms = 0;    ///< `asked_at` by the steady clock of that node; 0: not known
    std::string called_back;             ///< why no further link gets it; empty: any may
    std::vector<std::uint32_t> replaces; ///< those that were open when it came, and are called back for it
    std::vector<link_id> links;          ///< that may have it; none in a record of an older program
};

/// A packet of the provider's store.
struct replicated_packet {
    std::uint64_t position = 0;
    std::uint64_t yours = 0; ///< its position in the asker's store, where it came from there: then there is no packet
    std::optional<telemetry_packet> packet;
};

/// What of a store is known: everything up to these positions, in the numbering that was called `store`.
struct store_part {
    std::uint64_t store = 0;
    std::uint64_t packets = 0;
    std::uint64_t commands = 0; ///< changes of telecommands, the same
    bool operator==(const store_part&) const = default;
};

/// "Tell me what you have and I do not." Waits a while where there is nothing. What it says of the asker's disk is the
/// acknowledgement of what the pages before it told.
struct replication_request {
    static constexpr std::size_t max_yours = 16;

    std::string node;
    bool secondary = false;
    std::uint64_t origin = 0;      ///< of the asker's file, the same over all its lives: two nodes need two files
    std::uint64_t store = 0;       ///< the asker's
    bool keeps = true;             ///< the asker's disk takes what it is told
    std::vector<store_part> yours; ///< of your store on my disk, by its numbers in your last lives, the newest first
    std::uint32_t authority_epoch = 0; ///< on my disk
    std::uint64_t authority_change = 0;
    float wait_s = 1;
};
struct replication_page {
    std::string node;
    bool secondary = false;
    std::uint64_t origin = 0;
    std::uint64_t store = 0;
    std::uint64_t after = 0;                ///< what the asker knows holds up to here, and the packets follow it
    std::uint64_t commands_after = 0;       ///< the same of the changes of telecommands
    std::vector<replicated_packet> packets; ///< in order, without a gap
    std::vector<command_record> commands;   ///< the last state of those that changed
    std::uint64_t commands_up_to = 0;       ///< the position of the last of these
    authority_state authority;
    std::uint64_t authority_change = 0; ///< counts within an epoch: who asks for it
    bool more = false;
};

namespace services {

/// Errors: refused (both are primary, or secondary; it is the node itself; more than max_yours lives).
inline constexpr ise::request_response<replication_request, replication_page> replication{"replication"};

} // namespace services

} // namespace atirma
