#pragma once
#include <components/boat/packet_header.hpp>

#include <ise/core/time.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>

namespace atirma {

/// What the shore knows of the boat's clock, from the times of its packets. The boat judges by it whether a
/// telecommand is late, and it may be wrong by minutes where no GPS sets it. A packet that was measured at T by that
/// clock and comes now shows that the clock shows T or more; how much more, nobody knows. So the newest reading of the
/// fastest packet is a time that the boat's clock has certainly passed, and a validity that is counted from it ends in
/// time.
///
/// Readings hold for one boot of the boat, within which its clock for validities never goes back. They are kept against
/// the steady clock: the shore's own UTC does not matter, as long as the boat's is wrong. Without I/O.
class boat_clock {
public:
    /// A clock may lose so much of the time that passes; a reading is moved back by it.
    static constexpr int drift_parts = 10'000;
    /// Ahead of the shore's UTC by more than this, a time counts in its own boot only.
    static constexpr std::chrono::milliseconds max_ahead{1000};

    /// The time of a packet that came `now`. `current`: it was certainly made a moment ago, as an answer is, and so its
    /// boot is the boat's present one. Else one that was never heard before is, but for late packets of a former boot:
    /// they were measured before those of the present one.
    void heard(ise::time_point now, const packet_header& packet, bool current);
    /// The boat could not judge a time in UTC, or found it late: from now on it gets times by its own clock.
    void distrust(std::uint16_t boot);

    /// A time of sending for a telecommand.
    struct stamp {
        std::uint16_t boot = 0; ///< of the boat, whose clock it is by; 0: UTC
        utc_time at{};
    };
    stamp read(ise::time_point now, utc_time wall) const;
    /// A time that the boat told, by the shore's clock: not later than now.
    utc_time shore_time(ise::time_point now, utc_time wall, const packet_header& packet) const;

private:
    static constexpr std::size_t max_boots = 8;
    struct reading {
        std::uint16_t boot = 0;
        ise::duration ahead{}; ///< of the steady clock, at least
        ise::time_point at{};
        bool distrusted = false;
        ise::duration ahead_at(ise::time_point now) const;
        ise::duration shown() const { return at.time_since_epoch() + ahead; } // by the boat's clock, then
    };
    const reading* find(std::uint16_t boot) const;

    std::deque<reading> readings_; // the boat's present boot is first
};

} // namespace atirma
