#pragma once
#include <ise/core/bytes.hpp>

#include <array>
#include <cstdint>
#include <list>

namespace atirma {

/// Tells telemetry packets that were seen before, by boot, sequence and content, in bounded memory: of the last boots that were
/// heard, a window of sequence numbers below the newest. What lies below the window counts as new, so that history is not lost,
/// and so does another packet under a number that was seen: a forged one does not take the place of the boat's own.
class duplicate_filter {
public:
    static constexpr std::size_t max_boots = 8;
    static constexpr std::uint32_t window = 65536; // seven hours of all links together at two packets and a half a second

    /// Whether it comes for the first time; remembers it. `raw`: as it came, its checksum is at its end.
    bool first_time(std::uint16_t boot, std::uint32_t sequence, ise::bytes_view raw);

private:
    struct life {
        std::uint16_t boot = 0;
        std::uint32_t newest = 0;
        std::array<std::uint16_t, window> seen{}; // checksum of the last one under that number; 0 for none
    };
    std::list<life> lives_; // the one that was heard last is first
};

} // namespace atirma
