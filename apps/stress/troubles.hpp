#pragma once
#include "director.hpp"
#include "plan.hpp"

namespace atirma::stress {

/// How a trouble is made, and how it is over.
struct deed {
    std::string process;      ///< killed, and started again: by the path of its component; empty: none
    bool stops = false;       ///< it is stopped and continued instead
    director::job begin, end; ///< what an emulator is told; empty: nothing
};
deed deed_of(trouble what);

} // namespace atirma::stress
