#pragma once
#include "options.hpp"
#include "target.hpp"

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

namespace ise::cli {

/// What all subscribing commands have options for.
struct subscribe_choice {
    std::string name, service;
    std::string json; ///< the subscribe request
    bool latest = false;
    bool lossless = false;
    std::uint32_t depth = 1024;
};
void add_subscription(command_line::app& app, subscribe_choice& what);

/// Reaches the component and subscribes as the user chose; the rest of `terms` is the command's. `check` sees the
/// service before, and may throw.
task<dynamic_stream> open_stream(context& in, subscribe_choice choice, subscribe_options terms,
                                 std::function<void(const dynamic_contract&)> check);
task<dynamic_stream> open_stream(context& in, subscribe_choice choice, subscribe_options terms);

} // namespace ise::cli
