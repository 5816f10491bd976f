#pragma once
#include <ise/component/introspection.hpp>
#include <ise/service/dynamic.hpp>

namespace ise {

/// A service as a component described it, ready to be called or subscribed to. The schemas are parsed and their
/// fingerprints computed here: errc::malformed or errc::too_large for an invalid text.
result<dynamic_contract> contract_of(const service_info& message);

/// Queries a component and returns one of its services. errc::no_such_service lists its services; the other failures
/// are those of `remote::try_call`. Cancellation: terminal.
task<result<dynamic_contract>> discover(remote provider, std::string service, duration deadline = duration());

/// Whether a component provides a service. Queries the component instead of calling the service, which would count as a
/// refused call. Fails like `remote::try_call`. Cancellation: terminal.
task<result<bool>> provides(remote provider, std::string service, duration deadline = duration());

} // namespace ise
