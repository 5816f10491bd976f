#pragma once
#include <components/boat/packet_header.hpp>

#include <cstdint>
#include <span>

namespace atirma {

/// CRC-32 (IEEE 802.3: polynomial 04C11DB7, reflected; "123456789" gives CBF43926) of a list of waypoints as it lies on
/// air: i32 latitude and i32 longitude of each in 1e-7 degrees, little-endian.
std::uint32_t mission_checksum(std::span<const waypoint> list);

} // namespace atirma
