#pragma once
#include <ise/instantiation/launch_order.hpp>
#include <ise/instantiation/output_file.hpp>
#include <ise/instantiation/server_context.hpp>
#include <ise/naming/name_servers.hpp>

#include <string>

namespace ise::instantiation {

/// What is the same for all programs that a server starts.
inline launch_order common_order(const server_options& options, const std::string& program,
                                 const output_file& printed) {
    launch_order order;
    order.program = options.programs_folder + "/" + program;
    order.variables = options.variables;
    order.variables.emplace_back("ISE_NAME_SERVER", text_of(options.name_servers));
    order.output_file = printed.file();
    order.max_output_bytes = printed.max_bytes();
    return order;
}

} // namespace ise::instantiation
