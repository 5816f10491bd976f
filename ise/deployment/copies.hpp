#pragma once
#include <ise/deployment/value.hpp>

#include <cstddef>
#include <vector>

namespace ise::deployment {

inline constexpr std::size_t max_components = 256;

/// Replaces each component that has `copies = { first, last }` by one for each number from `first` to `last`, with the
/// number in place of `{n}` in its name and in all its texts; by none if `last` is lower. Variables are in already.
void make_copies(value& root, std::vector<problem>& problems);

} // namespace ise::deployment
