#pragma once
#include <components/boat/link_seal.hpp>
#include <components/boat/link_stage.hpp>
#include <components/boat/services.hpp>

#include <cstdint>
#include <map>

// What the Iridium proxy provides besides telemetry, telecommand and telecommand_state.
namespace atirma {

/// Of some time, both ways. A credit is what is paid for `bytes_per_credit` bytes, and for each message at least.
struct iridium_spending {
    std::uint64_t mo_messages = 0; ///< from the boat
    std::uint64_t mo_bytes = 0;
    std::uint64_t mo_credits = 0;
    std::uint64_t mt_messages = 0; ///< to the boat; one whose fate is not known is counted
    std::uint64_t mt_bytes = 0;
    std::uint64_t mt_credits = 0;
    bool operator==(const iridium_spending&) const = default;
};

struct iridium_queued {
    std::uint32_t id = 0;
    command_kind kind = command_kind::ping;
    link_stage stage = link_stage::waiting;
    std::uint8_t priority = 0; ///< 0 goes first
    std::uint32_t attempts = 0;
    std::string reference; ///< the gateway's number, once it has it
    std::string text;
    utc_time expires_at{};
};

/// The link, what it costs, and what waits. Days and months are those of UTC.
struct iridium_account {
    std::string day; ///< "2026-11-21"
    iridium_spending today;
    iridium_spending this_month;
    iridium_spending ever;                     ///< as far as the database goes back
    std::optional<std::uint64_t> daily_budget; ///< credits for telecommands; missing: unlimited
    std::optional<std::uint64_t> budget_left;  ///< of today
    std::vector<iridium_queued> queue;         ///< telecommands that are not decided, in the order in which they go
    std::string trouble;                       ///< what keeps telecommands or telemetry from going now; empty: nothing
    std::optional<utc_time> last_session_at;   ///< of the boat, as the gateway tells
    std::optional<waypoint> estimate;          ///< where the gateway believed the boat to be at `estimate_at`
    std::optional<double> estimate_cep_km;
    std::uint64_t messages = 0; ///< of the boat, since this proxy started
    std::uint64_t telemetry_published = 0;
    std::uint64_t duplicate_messages = 0;     ///< the gateway repeated itself
    std::uint64_t duplicate_packets = 0;      ///< that came in another message before
    std::uint64_t malformed = 0;              ///< packets that are none; kept on disk all the same
    std::uint64_t refused = 0;                ///< posts and connections: wrong token, IMEI, content
    std::uint64_t waiting_for_subscriber = 0; ///< messages on disk that nobody was there to take
    link_seal seal;
    std::optional<std::uint64_t> monthly_budget; ///< credits for telecommands; missing: unlimited
    std::optional<std::uint64_t> monthly_budget_left;
    std::optional<utc_time> beacon_session_at; ///< the last session of the second controller's modem
    std::optional<utc_time> estimate_at;       ///< the session, of either modem
};

namespace services {

inline constexpr ise::subscription<struct iridium_account> iridium_account{"iridium_account"};

} // namespace services

} // namespace atirma
