#pragma once
#include <components/boat/services.hpp>

#include <optional>

namespace atirma {

/// The newest packet of a kind, and where it comes from.
template <class Packet>
struct heard {
    Packet value;
    utc_time measured_at{}; ///< by the boat's clock, no later than it was received
    utc_time arrived_at{};  ///< by the clock of who heard it
    link_id link = link_id::xbee;
    std::uint16_t boot = 0;
};

/// Takes what is not older by the boat's clock, and no history: what comes late over a slow link never moves the
/// current value backwards. False where it was not taken.
template <class Packet>
bool take_newer(std::optional<heard<Packet>>& current, const Packet& result, const telemetry_packet& packet,
                utc_time arrived_at) {
    auto measured = plausible_time(packet);
    if (packet.history || (current && measured < current->measured_at)) return false;
    current = heard<Packet>{result, measured, arrived_at, packet.link, packet.boot};
    return true;
}

} // namespace atirma
