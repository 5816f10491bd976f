#pragma once
#include "survey.hpp"

#include <string>
#include <vector>

namespace ise::cli {

/// A service of one end of a connection that the other uses over it.
struct service_use {
    std::string service;
    bool a_provides = false; ///< else b
};

/// All sessions between two components, or of one with a peer that has no name.
struct connection_line {
    std::string a;
    std::string b;       ///< empty: anonymous
    std::string address; ///< of b, as a sees it
    std::string over;    ///< "tcp"
    std::size_t sessions = 0;
    std::uint64_t bytes_to_a = 0, bytes_to_b = 0; ///< since the sessions began
    duration round_trip{};                        ///< the longest; zero: not measured yet
    bool stalled = false;                         ///< one sees the other stalled
    std::vector<service_use> services;            ///< that went over these sessions
};

/// Who is connected to whom, seen from both ends. Sessions of commands that only look are left out.
std::vector<connection_line> connections_of(const std::vector<surveyed>& all);

} // namespace ise::cli
