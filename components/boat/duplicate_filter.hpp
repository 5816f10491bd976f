#pragma once
#include <ise/core/bytes.hpp>

#include <array>
#include <cstdint>
#include <list>
#include <map>

namespace atirma {

/// Tells telemetry packets that were seen before, by boot, sequence and content, in bounded memory: the newest sequence
/// numbers of the last boots that were heard share one window. What lies outside counts as new, so that history is not
/// lost, and so does another packet under a number that was seen: a forged one does not take the place of the boat's
/// own.
class duplicate_filter {
public:
    static constexpr std::size_t max_boots = 8, max_pages = 64;
    static constexpr std::uint32_t page = 1024; ///< sequence numbers, 2 KiB
    /// Seven hours of all links together at two packets and a half a second.
    static constexpr std::uint32_t window = max_pages * page;

    /// Whether it comes for the first time; remembers it. `raw`: as it came, its checksum is at its end.
    bool first_time(std::uint16_t boot, std::uint32_t sequence, ise::bytes_view raw);

private:
    struct life {
        std::uint16_t boot = 0;
        // Checksum of the last one under each number; 0 for none.
        std::map<std::uint32_t, std::array<std::uint16_t, page>> pages;
    };
    void make_room();
    std::list<life> lives_; // the one that was heard last is first
};

} // namespace atirma
