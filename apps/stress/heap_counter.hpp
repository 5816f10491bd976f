#pragma once
#include <cstdint>

namespace atirma::stress {

/// What `new` has given and `delete` has not taken back, in this program. SQLite's own memory is not among it: the
/// virtual disks.
struct heap_use {
    std::int64_t blocks = 0;
    std::int64_t bytes = 0;
    std::uint64_t allocations = 0; ///< so far
};
heap_use heap_now() noexcept;

} // namespace atirma::stress
