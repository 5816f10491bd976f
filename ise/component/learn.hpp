#pragma once
#include <ise/component/introspection.hpp>
#include <ise/service/dynamic.hpp>

namespace ise {

/// A service as a component described it, ready to be called or subscribed to. The schemas are parsed and their
/// fingerprints computed here: errc::malformed or errc::too_large where the text is none.
result<dynamic_contract> contract_of(const service_text& told);

/// Asks a component about itself and gives one of the services that it provides. errc::no_such_service names those
/// that there are; else the failures of `remote::try_call`. Cancellation: terminal.
task<result<dynamic_contract>> learn(remote provider, std::string service, duration deadline = duration());

/// Whether a component provides a service: asks it about itself, where a try would count as a call that it refused. Fails
/// as `remote::try_call` does. Cancellation: terminal.
task<result<bool>> provides(remote provider, std::string service, duration deadline = duration());

} // namespace ise
