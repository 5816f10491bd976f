#pragma once
#include <cstddef>

namespace ise {

/// Limits on decoding untrusted bytes.
struct decode_limits {
    std::size_t max_total_bytes = std::size_t{256} << 20; ///< memory of all strings and containers of one packet
    std::size_t max_depth = 64;                 ///< nesting of types that a cereal `serialize` reads recursively
    std::size_t max_zero_size_elements = 65536; ///< elements without bytes in one packet
};

} // namespace ise
