#pragma once
#include <ise/component/component.hpp>
#include <ise/naming/services.hpp>

#include <functional>
#include <optional>

namespace ise {

/// Follows all names that the name server knows, for as long as the component runs: `on_names` gets first those that
/// are there, then each change, and again all of them after the server was away. `name_server`: as
/// `name_server_for`. `on_trouble` (may be empty) gets why the names are not known; it is tried again every second.
/// Throws errc::invalid_argument where ISE_NAME_SERVER is no endpoint. Lifetime: `self` outlives it; what both
/// functions refer to, too. Cancellation: terminal.
task<> watch_names(component& self, std::optional<endpoint> name_server,
                   std::function<void(const naming::name_events&)> on_names,
                   std::function<void(const failure&)> on_trouble);

} // namespace ise
