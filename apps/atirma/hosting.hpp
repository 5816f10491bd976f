#pragma once
#include <apps/command_line.hpp>
#include <ise/component/component_type.hpp>
#include <ise/component/node.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace atirma {

/// One component that the command line asked for.
struct hosted {
    std::string path;
    std::vector<std::string> listen; ///< endpoints; empty: ISE's default
    std::vector<std::string> advertise;
    std::vector<std::string> roles; ///< "atirma/gateway=5"
    std::function<std::unique_ptr<ise::component>()> make;
    std::shared_ptr<ise::live_parameters> parameters;
};

/// The types of components of A-Tirma. Lines such as "ready: http://…" go to `announce`, from any thread.
std::vector<ise::component_type> component_types(std::function<void(const std::string&)> announce);

/// Those of the link over GPRS; component_types() has them, too.
std::vector<ise::component_type> gprs_types(const std::function<void(const std::string&)>& announce);

/// Adds types as subcommands of `run`, each with its parameters as options, and those that belong to a boat with
/// `--boats`. After parsing, those that were named stand in `into`, which outlives the parser. `types` makes the types
/// for each boat anew.
void add_components(command_line::app& run, std::vector<hosted>& into, const ise::type_maker& types);

} // namespace atirma
