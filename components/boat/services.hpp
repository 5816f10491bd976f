#pragma once
#include <components/boat/telecommand.hpp>

#include <ise/core/time.hpp>
#include <ise/session/contract.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

// What the proxy of any link provides, whichever link it is. Includers of this header need no other of the boat.
namespace atirma {

/// One telemetry packet as it came over a link. (boot, sequence) tells the same packet on two links.
struct telemetry_packet {
    link_id link = link_id::xbee;
    std::uint16_t boot = 0;
    std::uint32_t sequence = 0;
    utc_time measured_at{};       ///< by the boat's clock
    utc_time received_at{};       ///< by the clock of the proxy's host
    bool history = false;         ///< sent again after a gap: never the current position
    std::vector<std::byte> raw;   ///< for parse_telemetry(); its checksum was right
    std::uint64_t store = 0;      ///< of a communication node: whose numbering `position` belongs to; 0 from a proxy
    std::uint64_t position = 0;   ///< in that store: 1, 2, 3… without a gap
    std::uint64_t peer_store = 0; ///< of the other communication node; 0 where that is not known to have it
    std::uint64_t peer_position = 0;
};

/// When it counts as measured: one from the future counts by its reception, so that it hides nothing that is measured
/// afterwards.
inline utc_time plausible_time(const telemetry_packet& packet) noexcept {
    bool known = packet.received_at != utc_time(); // a proxy may not say
    return known && packet.measured_at > packet.received_at ? packet.received_at : packet.measured_at;
}

/// `{"id":7,"command":{"kind":"set_mode","mode":"hold"}}`. The same id with the same command again is the same
/// telecommand: it is not executed twice, and the reply tells what became of it.
struct telecommand_request {
    std::uint32_t id = 0; ///< chosen by the requester; 0: the proxy chooses one and tells it
    boat_command command;
    /// The boat executes it within this time or never, 1 … 86400. It counts from when the node or proxy has it, which
    /// goes on trying for so long, also after its reply. Missing: `default_validity`.
    std::optional<float> valid_s;
    std::optional<link_id> via;  ///< to a communication node: over this link only; missing: the best one that is alive
    bool confirmed = false;      ///< to a communication node: the operator has confirmed what is dangerous
    std::uint32_t authority = 0; ///< to a proxy: the epoch that travels to the boat; a node puts its own here
    /// The same by the shore's clock (UTC); the earlier end counts. One that is over is refused.
    std::optional<utc_time> valid_until;
};

/// invalid_argument where the boat would refuse an argument, or `valid_s` is out of range.
ise::result<void> check_request(const telecommand_request& request);
/// Whether one more of that kind has a place among the open ones. Those that save the boat (`command_priority::saves`)
/// have `most` places of their own, and all others have `most`, half of which those may take that need no authority: so
/// nobody keeps the holder of the authority from commanding the boat. Error: overloaded.
ise::result<void> check_place(const command_traits& of, const std::vector<command_kind>& open, std::size_t most);
/// The longest time that a call with this telecommand may take, of what is left of its validity. Its `valid_s` is the
/// rest: so it ends in time wherever the call was held up, and no clock has to agree with another one.
constexpr ise::duration time_to_give(ise::duration left) noexcept {
    return std::min<ise::duration>(std::chrono::seconds(5), left / 4);
}
/// How long it is valid from `now` on; nothing where its `valid_until` is over.
std::optional<std::chrono::milliseconds> validity_of(const telecommand_request& request, utc_time now, link_id over);

enum class telecommand_stage : std::uint8_t {
    pending = 0,      ///< only in a reply: not decided yet, follow telecommand_state
    queued = 1,       ///< waits for the link
    sent = 2,         ///< left the shore (it may be lost all the same)
    acknowledged = 3, ///< the boat answered: `result` says what
    failed = 4,       ///< cannot be sent
    expired = 5,      ///< its validity is over without an answer: it may have been executed
};
constexpr bool is_final(telecommand_stage stage) noexcept { return stage >= telecommand_stage::acknowledged; }
/// Of two things that are told of one telecommand, in whichever order, the heavier holds: 2 an answer of the boat, 1
/// any other end, 0 none.
constexpr int weight_of(telecommand_stage stage) noexcept {
    return stage == telecommand_stage::acknowledged ? 2 : is_final(stage) ? 1 : 0;
}

struct telecommand_reply {
    std::uint32_t id = 0;
    telecommand_stage state = telecommand_stage::pending;
    std::optional<ack_code> result;          ///< the boat's word; nothing before it was acknowledged
    std::optional<float> value;              ///< what holds at the boat now, for kinds that tell
    std::string text;                        ///< for people
    std::optional<std::uint32_t> boat_obeys; ///< the epoch of authority that the boat obeys, where it said so
    std::optional<utc_time> executed_at;     ///< by the shore's clock, as the boat's answer tells
};

/// A change in the life of a telecommand.
struct telecommand_status {
    std::uint32_t id = 0;
    link_id link = link_id::xbee;
    command_kind kind = command_kind::ping;
    telecommand_stage state = telecommand_stage::queued;
    std::optional<ack_code> result;
    std::optional<float> value;
    std::string text;
    utc_time at{};                           ///< of the change
    std::uint32_t attempts = 0;              ///< times that it was given to the link
    std::string asked_by;                    ///< from a communication node: the operator
    utc_time asked_at{};                     ///< by the clock of who tells it
    std::optional<boat_command> command;     ///< from a communication node: what was asked for
    std::uint32_t authority = 0;             ///< from a communication node: the epoch that it was sent under
    std::optional<std::uint32_t> boat_obeys; ///< the epoch that the boat obeys, where its answer said so
    std::optional<utc_time> valid_until;     ///< by the shore's clock; after it the boat does not execute it
    std::optional<utc_time> executed_at;     ///< by the shore's clock, as the boat's answer tells
    std::string asked_as; ///< from a communication node: the operator's verified identity; empty: it was not verified
};

/// Which telecommand to follow; 0: all.
struct follow_telecommand {
    std::uint32_t id = 0;
};
/// Where things stand at the beginning: what was asked for, of all those that are not decided yet.
struct followed_telecommands {
    std::vector<telecommand_status> now;
};

/// Packets that a proxy has in hand and has not acknowledged to the boat.
struct keep_request {
    static constexpr std::size_t max_packets = 256;
    std::vector<telemetry_packet> packets; ///< at most max_packets, each with at most 1024 raw bytes
};
struct keep_reply {
    std::uint32_t fresh = 0;  ///< so many of them were not known before
    std::uint32_t copies = 1; ///< disks that have all of them: 2 as long as a secondary lives
};

namespace services {

inline constexpr ise::subscription<telemetry_packet> telemetry{"telemetry"};

/// Provided by communication nodes (role `atirma/communication`). The reply says that every packet of the request is on
/// disk, at the secondary too while one lives: now the boat may be acknowledged. A packet that is known already counts
/// as kept, so that asking again is always safe. A failed call keeps nothing for certain: do not acknowledge, ask again
/// later. Errors: refused (the disk is full, too many packets, no raw bytes).
inline constexpr ise::request_response<keep_request, keep_reply> telemetry_store{"telemetry_store"};

/// Waits for the boat's acknowledgement as far as the call's deadline allows, else replies `pending`. Error: refused
/// (bad validity or place, an id that stands for another command, too many that are open); it then had no effect.
inline constexpr ise::request_response<telecommand_request, telecommand_reply> telecommand{"telecommand"};

inline constexpr ise::subscription<telecommand_status, follow_telecommand, followed_telecommands> telecommand_state{
    "telecommand_state"};

} // namespace services

} // namespace atirma
