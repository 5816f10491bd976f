#pragma once
#include <cstddef>
#include <cstdint>

/// What a peer may cost at most, where that is no option of the user: the constants of every layer in one place.
/// LIMITS.md lists them together with the options, and says what happens beyond each.
namespace ise::limit {

// wire, net: one connection.
inline constexpr std::uint32_t greeting_bytes = 16u << 10; ///< body of a frame before the handshake is over
inline constexpr std::size_t unfinished_messages = 64;     ///< messages in pieces under way at once
inline constexpr std::size_t control_bytes = std::size_t{4}
                                             << 20; ///< answers of the connection that the peer does not read

// service: one session.
inline constexpr std::uint32_t introduced_services = 4096;
inline constexpr std::size_t service_name_bytes = 200;
inline constexpr std::size_t service_fingerprints = 16; ///< packets of one service; the kinds have at most five
inline constexpr std::size_t held_requests = 256;       ///< of one service, while its schemas are asked for
inline constexpr std::size_t held_replies = 1024;       ///< the same on the caller's side
inline constexpr std::size_t schema_questions = 256;    ///< open at once
inline constexpr std::size_t asked_schemas = 64;        ///< in one question of the peer

// component: one process.
inline constexpr std::size_t metric_series = 50'000; ///< lines of its metrics; services beyond are left out

// service: one component.
inline constexpr std::size_t kept_services = 4096; ///< services learnt of at run time
/// Services of others that a component is known to use, each at each target.
inline constexpr std::size_t used_services = 256;
inline constexpr std::size_t described_calls = 256;           ///< under way, that ise.describe lists, of each direction
inline constexpr std::size_t waiting_calls = 100'000;         ///< of this side, for a session with one peer
inline constexpr std::uint32_t subscription_depth = 1u << 20; ///< packets held for one subscriber, whatever it asks for

} // namespace ise::limit
