#pragma once
#include <components/web_server/track_line.hpp>

#include <chrono>
#include <cstdint>
#include <string>

namespace atirma {

struct track_options {
    std::string boat = "A-Tirma";          ///< its name
    std::string id = "a-tirma";            ///< in the page's addresses
    std::string epoch = "0";               ///< differs each time the server starts; letters, digits, '-'
    std::chrono::seconds status_period{5}; ///< the pace of `status`; the page calls the server lost after three
    std::chrono::hours max_age{24 * 60};   ///< reports that are older when received are refused
    std::size_t max_waypoints = 500;
    track_limits track;
};

struct track_statistics {
    std::uint64_t accepted = 0;
    std::uint64_t refused = 0;         ///< out of range, not a number, or too old
    std::uint64_t out_of_order = 0;    ///< older than what is current: history, or overtaken on another link
    std::uint64_t clock_corrected = 0; ///< dated by reception
};

} // namespace atirma
