#pragma once
#include "../transports.hpp"

/// A transport that ISE does not have: `odd://host:port` is TCP in pieces of odd sizes, with writes that block for no
/// reason. It shows what a new transport takes: this folder, and its column in pair.hpp.
namespace conformance {

struct odd : real_world {
    odd();
};
/// Without loss: what it sends is more packets than that of tcp, and each that is lost holds up all behind it.
struct virtual_odd : virtual_world {
    virtual_odd();
};

} // namespace conformance
