#pragma once
#include <array>
#include <cstdint>
#include <deque>

namespace atirma::gprs {

/// Tells what is news from what is history, whatever the line says: of each type of packet only what was measured after
/// the newest one so far can be current, in the order that the boat counts in.
class freshness {
public:
    /// Whether this packet is history; remembers it where it is not. `told`: the boat says so itself.
    bool is_history(bool told, std::uint16_t boot, std::uint8_t type, std::uint32_t sequence);

private:
    static constexpr std::size_t remembered_boots = 8;
    std::deque<std::uint16_t> past_; // boots that the present one came after
    std::uint16_t boot_ = 0;
    bool any_ = false;
    std::array<std::uint64_t, 256> next_{}; // by type: what is at least this is news
};

} // namespace atirma::gprs
