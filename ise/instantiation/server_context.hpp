#pragma once
#include <ise/component/component.hpp>
#include <ise/instantiation/launch_rules.hpp>
#include <ise/instantiation/machine.hpp>
#include <ise/naming/services.hpp>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace ise::instantiation {

struct server_options {
    std::string programs_folder;                                  ///< what can be started lies here
    std::string state_folder;                                     ///< of this server alone; it exists
    std::vector<endpoint> name_servers = {default_name_server()}; ///< told to what it starts
    std::vector<std::pair<std::string, std::string>> variables;   ///< of what it starts: PATH, HOME and the like
    launch_rules rules;
    std::size_t max_instances = 64; ///< those that have ended count until their place is needed
    std::size_t max_starts = 30;    ///< within `starts_window`, of all kinds
    duration starts_window = std::chrono::seconds(10);
    std::uint64_t max_output_bytes = 256 << 10; ///< of each of the two output files of an instance
    duration describe_within = std::chrono::seconds(5);
    duration look_every = std::chrono::milliseconds(200); ///< at the output
};

/// What all parts of an instantiation server work with: the component whose coroutines they are, and its host. Parts
/// live on the component's loop, and as long as it.
struct server_context {
    component& self;
    machine& host;
    server_options options;
    bool stopping = false; ///< nothing is decided any more; what was started goes on
};

} // namespace ise::instantiation
