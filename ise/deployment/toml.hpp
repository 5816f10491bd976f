#pragma once
#include <ise/deployment/value.hpp>

#include <string>
#include <vector>

namespace ise::deployment {

/// The table that a TOML text is; `file` is the name for places. What cannot be read is added to `problems`.
value parse_toml(const std::string& text, const std::string& file, std::vector<problem>& problems);

} // namespace ise::deployment
