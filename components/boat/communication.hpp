#pragma once
#include <components/boat/services.hpp>

#include <map>

// What a communication node provides beside telemetry, telemetry_store, telecommand and telecommand_state: everything
// of the boat over all links together. Ask the role, not the node, and it goes on when one of the nodes dies.
namespace atirma {

/// The role that both communication nodes serve.
inline constexpr std::string_view communication_role = "atirma/communication";

/// What somebody knows already: of each store, its packets up to that position. At most 8 stores.
using track_cursor = std::map<std::uint64_t, std::uint64_t>;

/// Packets that were kept, in the order of the store. Without `from` and `until` all of them.
struct track_request {
    track_cursor seen;               ///< these are left out; for the next page: what the last one told
    std::optional<utc_time> from;    ///< measured then or later
    std::optional<utc_time> until;   ///< measured before
    std::uint32_t max_packets = 500; ///< 1 … 1000
};
struct track_page {
    std::vector<telemetry_packet> packets;
    track_cursor seen; ///< what is known once these are
    bool more = false;
};

/// Who may tell the boat what to do.
struct authority_state {
    std::string holder;      ///< the operator's path; empty: nobody
    std::uint32_t epoch = 0; ///< grows with each change, at both nodes; 0: nobody ever had it
    utc_time since{};
    std::string how;                   ///< "taken by atirma/console/ana"
    std::vector<std::string> asked_by; ///< operators who ask the holder for it
    /// Travels in every telecommand. The same as `epoch`, unless the boat said that it obeys another one.
    std::uint32_t boat_epoch = 0;
};

enum class authority_action : std::uint8_t {
    look = 0,      ///< changes nothing
    take = 1,      ///< what nobody holds; with `confirmed`, also against the holder's will
    ask = 2,       ///< tells the holder
    hand_over = 3, ///< by the holder, to the operator `to`
    release = 4,   ///< by the holder
};

/// `{"action":"take"}`. The operator is who calls.
struct authority_request {
    authority_action action = authority_action::look;
    std::string to;
    bool confirmed = false;
};

/// Which telecommands to list, newest first.
struct record_request {
    std::uint64_t before = 0;        ///< number of the oldest one of the last page; 0: from the newest
    std::uint32_t max_entries = 100; ///< 1 … 500
    std::string asked_by;            ///< of this operator only; empty: everybody's
};
struct record_page {
    std::vector<telecommand_status> entries;
    std::uint64_t before = 0;               ///< for the next page; 0: there is no more
    std::vector<authority_state> authority; ///< on the first page: the last changes, newest first
};

struct link_health {
    link_id link = link_id::xbee;
    std::string proxy;
    bool reached = false; ///< the proxy answers
    bool alive = false;   ///< the boat was heard over it lately
    utc_time last_heard{};
    std::uint64_t packets = 0; ///< telemetry, duplicates included
    std::uint64_t lost = 0;    ///< published by the proxy, and not received here
    std::uint64_t gaps = 0;    ///< of unknown length: the proxy restarted
    std::string trouble;       ///< why the proxy is not reached; empty where it is
};

/// The newest fix of all links.
struct current_fix {
    link_id link = link_id::xbee;
    utc_time measured_at{};
    double latitude_deg = 0;
    double longitude_deg = 0;
    bool beacon = false; ///< told by the boat's second controller, as the main one or its power fails
};

/// How a communication node is.
struct communication_state {
    std::string node;
    bool secondary = false;
    bool serving = false;          ///< offers itself under the role
    std::string trouble;           ///< why nothing can be kept now; empty where it can
    std::string store_notice;      ///< what befell its store since it started: set back in time, or damaged and set
                                   ///< aside; empty where nothing did
    std::uint64_t store = 0;       ///< the number of this life of its store
    std::uint64_t packets = 0;     ///< kept
    std::uint64_t shown = 0;       ///< of these, told to subscribers: the others wait for the other node
    std::uint64_t duplicates = 0;  ///< dropped
    std::uint64_t refused = 0;     ///< no raw bytes, or too many
    std::uint64_t held = 0;        ///< in memory, for want of a disk that takes them
    std::uint64_t dropped = 0;     ///< of these, the oldest, as they became too many
    std::string peer;              ///< the other node; empty: none was named
    bool peer_lives = false;       ///< and can keep
    std::uint64_t peer_misses = 0; ///< packets that the other node does not have yet
    std::vector<link_health> links;
    std::optional<current_fix> fix;
    std::uint64_t telecommands_open = 0;
    authority_state authority;
};

namespace services {

/// Bounded pages of what is kept. Errors: refused (more than 8 stores, max_packets out of range, the disk).
inline constexpr ise::request_response<track_request, track_page> track{"track"};

/// Who calls is known by the path that it claims, which nobody checks; one without a path may only look. The reply is
/// what holds then; it is on disk, at the other node too while that lives. Errors: refused, with who holds the
/// authority and what to do.
inline constexpr ise::request_response<authority_request, authority_state> authority{"authority"};
inline constexpr ise::subscription<authority_state> authority_changes{"authority_state"};

inline constexpr ise::request_response<record_request, record_page> telecommand_record{"telecommand_record"};

/// As `telecommand`, for raw telecommands only, which that one refuses: so that an access policy grants them by
/// themselves. Errors: refused as well where they are off at the node.
inline constexpr ise::request_response<telecommand_request, telecommand_reply> raw_telecommand{"raw_telecommand"};

inline constexpr ise::subscription<communication_state> communication{"communication_state"};

} // namespace services

} // namespace atirma
