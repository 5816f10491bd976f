#include <components/boat/mission_checksum.hpp>

#include <cmath>
#include <cstddef>

namespace atirma {
namespace {

void add(std::uint32_t& crc, double degrees) {
    auto steps = static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(degrees / 1e-7)));
    for (int i = 0; i < 4; ++i) {
        crc ^= (steps >> (8 * i)) & 0xFF;
        for (int bit = 0; bit < 8; ++bit) crc = crc & 1 ? (crc >> 1) ^ 0xEDB88320u : crc >> 1;
    }
}

} // namespace

std::uint32_t mission_checksum(std::span<const waypoint> list) {
    std::uint32_t crc = 0xFFFFFFFF;
    for (const auto& at : list) {
        add(crc, at.latitude_deg);
        add(crc, at.longitude_deg);
    }
    return ~crc;
}

} // namespace atirma
