#pragma once
#include <ise/component/component_type.hpp>
#include <ise/component/node.hpp>

#include <stdexcept>
#include <string>
#include <vector>

namespace ise::detail {

/// Words that a program was given and that make no sense; its text says which.
struct wrong_words : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// What follows `run TYPE`, or `host`: where the component is, and what its node is told.
struct program_words {
    std::string path;
    component_options component;
    node_options node;
    std::vector<endpoint> control; ///< of a host
    bool help = false;             ///< asked for, in place of a run
};

/// The type of that name; `wrong_words` names those that there are.
component_type& type_among(std::vector<component_type>& types, const std::string& name);

/// Reads options, `--name=value` or `--name value`; parameters go to `type`, where there is one. `wrong_words` says
/// what is wrong.
program_words read_words(const std::vector<std::string>& words, component_type* type);

/// What `run TYPE --help` prints.
std::string help_of(const std::string& program, const component_type& type);
/// What `--help` prints.
std::string help_of(const std::string& program, const std::vector<component_type>& types, bool shares);

/// Completes what was read by the environment's parameters: ISE_PARAMETER_WIND_SPEED. `wrong_words` says what is wrong.
void take_parameters(component_type& type, component_options& into, environment& world);

/// Runs components of a program on threads of this process, as an instantiation server asks for them at the endpoints
/// `where.control`, until SIGINT or SIGTERM. Gives the exit code.
int run_process_host(const type_maker& types, program_words where, const std::string& program);

} // namespace ise::detail
