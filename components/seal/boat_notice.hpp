#pragma once
#include <components/seal/sealed_frame.hpp>

namespace atirma::seal {

/// What the boat says of its counters: after a loss of memory, and when it refuses a sealed packet.
struct boat_notice {
    session of = no_session;                ///< to be used for what is sent to it
    std::array<std::uint64_t, 2> highest{}; ///< counter that it has accepted in this session, by lane; 0: none
    bool operator==(const boat_notice&) const = default;
};

/// A plain packet with a checksum.
ise::bytes encode_notice(const boat_notice& notice);
/// Errors: malformed.
ise::result<boat_notice> parse_notice(ise::bytes_view plain);

} // namespace atirma::seal
