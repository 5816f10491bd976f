#pragma once
#include <ise/name_server/schema_store.hpp>
#include <ise/naming/services.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace ise {

/// Limits of the name server. A claim that exceeds a limit by itself is refused, with the limit's name; a claim for
/// which there is no room now waits.
struct registry_limits {
    std::size_t max_components = 100'000; ///< registered at once
    /// Under one lease, so that no other is kept out by mistake; also lost ones, until it knows.
    std::size_t max_components_per_node = 50'000;
    std::size_t max_services = 1'000'000;                  ///< of all components together
    std::size_t max_services_per_component = 1024;         ///< provided and required
    std::size_t max_claims_bytes = std::size_t{512} << 20; ///< memory of all claims together, without the schemas
    std::size_t max_endpoints_per_component = 64;          ///< of one claim
    std::size_t max_roles_per_component = 64;              ///< that it serves
    std::size_t max_members_per_role = 256;                ///< that serve it
    std::size_t max_nodes = 50'000;                        ///< with a lease
    std::size_t max_path_bytes = 200;                      ///< of one path
    std::size_t max_text_bytes = 512;                      ///< of every other name, state and endpoint
    std::size_t max_listed = 10'000;                       ///< in one answer
    std::size_t max_listed_bytes = std::size_t{64} << 20;  ///< memory of the claims that one answer lists
    std::size_t max_remembered = 100'000;                  ///< paths whose last epoch is known though nobody holds them
    schema_store_limits schemas;                           ///< of texts
};

/// No clock gives such an epoch, or a higher one: in microseconds the year 2255.
inline constexpr std::uint64_t highest_epoch = std::uint64_t{1} << 53;

/// The maximum memory of a claim: all copies of its texts, and the entries around them.
std::size_t memory_of(const naming::component_claim& claim);

/// Why a claim can never be accepted; empty if it can.
std::optional<std::string> objection_to(const naming::node_identity& who, const registry_limits& limits);
/// The same for one component.
std::optional<std::string> objection_to(const naming::component_claim& claim, const registry_limits& limits);

} // namespace ise
