#pragma once
#include "commands.hpp"
#include "target.hpp"

#include <optional>

namespace ise::cli {

/// Reaches the component and subscribes as the user chose; the rest of `terms` is the command's.
task<dynamic_stream> open_stream(context& in, subscribe_choice choice, subscribe_options terms);

/// "3 packets were lost", or that the provider restarted.
std::string show_loss(std::optional<std::uint64_t> lost);

} // namespace ise::cli
