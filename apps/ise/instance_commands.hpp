#pragma once
#include "commands.hpp"

#include <string>

namespace CLI {
class App;
}

namespace ise::cli {

/// What the commands about instances are told; outlives the parse.
struct instance_places {
    start_options start;
    ps_options ps;
    instance_options which;
    logs_options logs;
    std::string policy = "never", ready_within, grace;
    std::size_t lines = 0;
    duration patience{}; ///< instead of the usual timeout: starting and stopping take their time
};

void add_instance_commands(CLI::App& app, instance_places& to, wish& made);

} // namespace ise::cli
