#pragma once
#include "commands.hpp"

namespace CLI {
class App;
}

namespace ise::cli {

/// What the commands about deployments and parameters are told; outlives the parse.
struct deployment_places {
    deployment_options file;
    param_options param;
    std::string value;
    duration patience{}; ///< instead of the usual timeout
};

void add_deployment_commands(CLI::App& app, deployment_places& to, wish& made);

} // namespace ise::cli
