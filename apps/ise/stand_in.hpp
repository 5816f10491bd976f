#pragma once
#include "target.hpp"

#include <ise/service/dynamic.hpp>

#include <string>

/// Commands that provide services in the place of a component: `pub` and `mock`.
namespace ise::cli {

/// Where the command listens, and knows the packets of a service from.
struct stand_in_options {
    std::string path;   ///< under which it is registered
    std::string listen; ///< an endpoint; empty: the usual ones
    std::string types;  ///< a file with what `ise type show --json` printed
    std::string like;   ///< a component that provides or needs the service
};
/// PATH and the options above. To be called with what `read_command_line` makes of them, too: `takes_place`.
void add_stand_in(command_line::app& app, stand_in_options& into);
/// The command runs as the component `of.path`. Throws problem(usage).
void takes_place(const stand_in_options& of, parsed_command& made);

/// The packets of a service: from the file, from the component, or else from all that are running and provide or need
/// a service of this name. problem(not_reached) where nobody knows it, problem(usage) where they differ.
task<dynamic_contract> contract_for(context& in, stand_in_options from, std::string service);

/// problem(failed) if somebody else has the name; problem(not_reached) without a name server, unless `--listen` says
/// where it is to be found.
task<> check_place(context& in, stand_in_options of);

/// Registers, and notes where it listens. Call it when everything is provided.
task<> take_place(context& in);

} // namespace ise::cli
