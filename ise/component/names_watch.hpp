#pragma once
#include <ise/component/component.hpp>
#include <ise/naming/services.hpp>

#include <functional>
#include <vector>

namespace ise {

/// Follows all names that the name server knows, for as long as the component runs: `on_names` gets first those that
/// are there, then each change, and again all of them after the server was away. `name_servers`: none means
/// `usual_name_servers`. `on_trouble` (may be empty) gets why the names are not known; it is tried again every second.
/// Throws errc::invalid_argument where ISE_NAME_SERVER is no list of endpoints. Lifetime: `self` outlives it; what both
/// functions refer to, too. Cancellation: terminal.
task<> watch_names(component& self, std::vector<endpoint> name_servers,
                   std::function<void(const naming::name_events&)> on_names,
                   std::function<void(const failure&)> on_trouble);

} // namespace ise
