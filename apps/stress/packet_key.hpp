#pragma once
#include <components/boat/telecommand.hpp>

#include <cstdint>
#include <optional>

namespace atirma::stress {

/// A packet of the boat, whichever way it comes: boot above, sequence below.
using packet_key = std::uint64_t;

constexpr packet_key key_of(std::uint16_t boot, std::uint32_t sequence) noexcept {
    return (std::uint64_t{boot} << 32) | sequence;
}

/// Of telemetry only; nothing for acknowledgements and for what makes no sense.
inline std::optional<packet_key> telemetry_key(ise::bytes_view raw) {
    if (classify(raw) != packet_class::telemetry) return std::nullopt;
    auto message = parse_telemetry(raw);
    if (!message) return std::nullopt;
    return key_of(message->header.boot, message->header.sequence);
}

} // namespace atirma::stress
