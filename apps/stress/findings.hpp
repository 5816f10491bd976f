#pragma once
#include "account.hpp"

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace atirma::stress {

/// What the disk of the primary node and the log of the operators say, brought into the shape in which it is reported.
/// Pure.
struct findings {
    /// A silence of one link, or of all of them together, with what may have caused it.
    struct gap {
        ise::duration from{}, until{};
        std::string cause; ///< empty: none is known
    };
    struct fix {
        utc_time at{};
        double latitude_deg = 0, longitude_deg = 0;
        link_id link = link_id::xbee;
        bool history = false; ///< told later than it happened
    };
    struct span {
        ise::duration from{}, until{};
    };

    explicit findings(const account& of);

    std::array<std::map<std::string, std::uint64_t>, link_count> by_type; ///< of each link: "location" → 12
    std::array<std::uint64_t, link_count> history{};
    std::vector<fix> track; ///< in the order of time
    std::array<std::vector<gap>, link_count> gaps;
    std::vector<gap> track_gaps;                     ///< nothing of any link tells where the boat was
    std::array<std::vector<span>, link_count> heard; ///< when something arrived over it, again and again

    /// What may have cost packets of that link that are lost: each cause with how many.
    static std::map<std::string, std::uint64_t> causes_of(const account& of, const std::vector<ledger::entry>& lost,
                                                          link_id link);
    static ise::duration silence_of(link_id link, const voyage_plan& script); ///< longer than this is a gap
};

/// 3:07:59.
std::string clock_text(ise::duration since_start);
/// "340 ms", "12.3 s", "3:07 min", "1:03:07 h".
std::string length_text(ise::duration length);
/// "30 minutes", "1 hour", "1 hour 30 minutes": the length of a voyage, to the minute.
std::string voyage_text(ise::duration length);
/// "1 gap", "2 gaps".
std::string counted(std::uint64_t count, std::string_view one);

} // namespace atirma::stress
