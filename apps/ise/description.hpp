#pragma once
#include <ise/component/introspection.hpp>
#include <ise/service/dynamic.hpp>
#include <ise/service/resolver.hpp>

#include <string>

namespace ise::cli {

/// A component's description as one line of JSON (README.md lists the fields). `who` is found under `name`, the members
/// if it is a role.
std::string as_json(const component_info& about, const std::string& name, const resolution& who);
/// The members of a role, for people.
std::string role_page(const std::string& role, const resolution& who, std::size_t width);

/// A line that a shell takes: how to call the service of `name`, or subscribe to it, with every field at its default.
std::string example(const std::string& name, const dynamic_contract& service);

/// The same for people. `name` is what they called it by, for the examples.
std::string as_page(const component_info& about, const std::string& name, std::size_t width);

} // namespace ise::cli
