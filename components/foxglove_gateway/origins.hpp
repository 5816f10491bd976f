#pragma once
#include <string>
#include <vector>

namespace ise::foxglove {

/// Whether a page of this origin may connect; an empty one is no page.
bool is_allowed_origin(const std::string& origin, const std::vector<std::string>& allowed);

} // namespace ise::foxglove
