#pragma once
#include <cstddef>

namespace ise {

/// What decoding may cost, whatever the bytes claim.
struct decode_limits {
    std::size_t max_total_bytes = std::size_t{256} << 20; ///< memory of all strings and containers of one packet
    std::size_t max_depth = 64;                  ///< nesting of types that a cereal `serialize` reads recursively
    std::size_t max_zero_size_elements = 65536;  ///< elements that take no byte, in one packet
};

} // namespace ise
