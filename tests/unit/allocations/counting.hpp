#pragma once
#include <cstdint>

namespace ise_test {

/// How often operator new was called in this program so far.
std::uint64_t allocations() noexcept;

} // namespace ise_test
