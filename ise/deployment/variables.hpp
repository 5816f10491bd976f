#pragma once
#include <ise/deployment/value.hpp>

#include <string>
#include <utility>
#include <vector>

namespace ise::deployment {

/// Variables that were given beside the file: name and value.
using settings = std::vector<std::pair<std::string, std::string>>;

/// Puts the variables of a file's table in: `${name}` in any text, `$$` for a dollar sign; a text that is nothing but
/// `${name}` becomes what the variable is. `given` stands above the file, whose table `variables` says which there are.
void put_variables_in(value& into, const settings& given, std::vector<problem>& problems);

} // namespace ise::deployment
