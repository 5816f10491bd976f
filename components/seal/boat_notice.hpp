#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <array>
#include <cstdint>

namespace atirma::seal {

/// What the boat says of its memory of counters: after its start, and when it refuses a packet with a good tag.
struct boat_notice {
    std::uint64_t challenge = 0;            ///< random, new at each start of the boat
    std::array<bool, 2> known{};            ///< by lane; false: it obeys a resync only
    std::array<std::uint64_t, 2> highest{}; ///< counter that it has accepted
    bool operator==(const boat_notice&) const = default;
};

/// A plain packet with a checksum.
ise::bytes encode_notice(const boat_notice& notice);
/// Errors: malformed.
ise::result<boat_notice> parse_notice(ise::bytes_view plain);

} // namespace atirma::seal
