#pragma once
#include "run.hpp"

namespace seeds {

struct pool_options {
    std::uint64_t from = 1;
    std::uint64_t seeds = 200;
    unsigned jobs = 1;
    double seconds = 0; ///< of real time, after which no further seed begins; 0: no limit
    run_options run;
};

/// Plays seeds over several processes, so that one that crashes or hangs is told with its seed and the others go on.
/// Prints what failed and a summary. Whether all passed.
bool play_all(const pool_options& options);

} // namespace seeds
