#pragma once
#include <apps/stress/account.hpp>

#include <set>

namespace atirma::stress {

/// What these processes use now, all together; one that has ended does not count.
void measure(sample& into, const std::set<std::uint64_t>& processes);

} // namespace atirma::stress
