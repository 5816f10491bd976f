#pragma once
#include <memory_resource>

namespace atirma::stress {

/// For what the run itself keeps and never forgets: it is no part of what it looks at, and its memory does not come by
/// operator new.
std::pmr::memory_resource* memory_apart();

} // namespace atirma::stress
