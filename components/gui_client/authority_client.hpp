#pragma once
#include <components/gui_client/client_context.hpp>
#include <components/gui_client/operator_port.hpp>

#include <string>

namespace atirma::console {

/// Changes the authority over the boat at the communication nodes.
class authority_client {
public:
    explicit authority_client(client_context& context) : context_(context) {}

    /// Requests the change; its result is shown in the state. Cancellation: terminal.
    ise::task<> change(change_authority what);
    /// Takes the authority as far as `how` permits. Returns why this console does not have it; empty where it does or
    /// needs none. Cancellation: terminal.
    ise::task<std::string> acquire(taking how);

private:
    client_context& context_;
};

} // namespace atirma::console
