#pragma once
#include "rates.hpp"

#include <nlohmann/json_fwd.hpp>

#include <string>
#include <vector>

namespace ise::cli {

/// The services and publications at work, for people: those that lose something first, then by what waits and how busy
/// they are, `most` of each kind. Empty where none is.
std::string services_table(const std::vector<activity>& all, std::size_t width, std::size_t most);

/// All of a component, at work or not.
nlohmann::ordered_json services_json(const activity& of);

} // namespace ise::cli
