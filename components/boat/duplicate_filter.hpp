#pragma once
#include <bitset>
#include <cstdint>
#include <list>

namespace atirma {

/// Tells telemetry packets that were seen before, by boot and sequence, in bounded memory: of the last boots that were heard,
/// a window of sequence numbers below the newest. What lies below the window counts as new, so that history is not lost.
class duplicate_filter {
public:
    static constexpr std::size_t max_boots = 8;
    static constexpr std::uint32_t window = 65536; // seven hours of all links together at two packets and a half a second

    /// Whether it comes for the first time; remembers it.
    bool first_time(std::uint16_t boot, std::uint32_t sequence);

private:
    struct life {
        std::uint16_t boot = 0;
        std::uint32_t newest = 0;
        std::bitset<window> seen;
    };
    std::list<life> lives_; // the one that was heard last is first
};

} // namespace atirma
