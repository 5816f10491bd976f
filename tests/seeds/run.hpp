#pragma once
#include "sabotage.hpp"

#include <cstdint>
#include <map>
#include <string>

namespace seeds {

/// What came of one seed.
struct outcome {
    bool passed = true;
    std::string violation;   ///< the invariant that did not hold, with the time
    std::string newest;      ///< the last events before it
    std::uint64_t steps = 0; ///< events of the virtual world
    std::uint64_t hash = 0;  ///< of everything that happened
    double virtual_seconds = 0;
    std::size_t max_memory = 0;     ///< bytes in use at once, beyond those before the run
    std::ptrdiff_t memory_left = 0; ///< bytes that were not given back
    std::map<std::string, std::uint64_t> tallies;
};

struct run_options {
    bool verbose = false; ///< prints the plan and each event
    bug planted = bug::none;
};

/// Plays one seed from its first event to its last and checks every invariant after each of them.
outcome play(std::uint64_t seed, const run_options& options = run_options());

} // namespace seeds
