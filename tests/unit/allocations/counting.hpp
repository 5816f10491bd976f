#pragma once
#include <cstddef>
#include <cstdint>

namespace ise_test {

/// How often operator new was called in this program so far.
std::uint64_t allocations() noexcept;
/// The allocation that comes after this many others throws std::bad_alloc, once.
void refuse_allocation_after(std::int64_t others) noexcept;
void refuse_no_allocation() noexcept;
/// The same for malloc and realloc, by which buffers grow.
void refuse_growth_after(std::int64_t others) noexcept;
void refuse_no_growth() noexcept;
/// How often realloc or malloc was called, by which buffers grow.
std::uint64_t reallocations() noexcept;
/// The same, where it was for a page or more.
std::uint64_t large_reallocations() noexcept;
/// The most that was asked for at once since the last call of this.
std::size_t take_largest_reallocation() noexcept;

} // namespace ise_test
