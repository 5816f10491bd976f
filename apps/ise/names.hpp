#pragma once
#include "conversation.hpp"

#include <string>
#include <vector>

namespace ise::cli {

/// problem(usage) unless it can be a component's path, or a role's: nothing else is looked up.
void check_name(const std::string& name);
/// The same of a PREFIX, which may be empty or end in a slash.
void check_prefix(const std::string& prefix);

/// Says on standard error that nothing is registered under it, with the nearest of `known`.
void note_nothing(const context& in, const std::string& prefix, const std::vector<std::string>& known = {});

/// "1 name is", "3 names are"
std::string names_are(std::size_t count);

} // namespace ise::cli
