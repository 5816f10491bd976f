#pragma once
#include <ise/component/introspection.hpp>

#include <string>

namespace ise::cli {

/// A component's description as one line of JSON (README.md lists the fields).
std::string as_json(const component_text& about);

/// The same for people. `name` is what they called it by, for the examples.
std::string as_page(const component_text& about, const std::string& name, std::size_t width);

} // namespace ise::cli
