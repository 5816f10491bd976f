#pragma once
#include <components/xbee/at_command.hpp>
#include <components/xbee/modem_port.hpp>
#include <components/xbee_proxy/services.hpp>

#include <ise/core/waiter.hpp>

#include <functional>
#include <map>

namespace atirma {

/// The parameters of the local modem: asks for those that `xb_local` publishes, and reads or sets one by name. Used on
/// its port's loop.
class local_modem {
public:
    local_modem(ise::loop& on, xbee::modem_port& port) : loop_(on), port_(port) {}

    /// Asks for every published value, in the background; those not answered are forgotten.
    void refresh();
    /// The port's events; true if it was an answer to one of these requests.
    bool on_event(const xbee::client_event& event);
    void fill(xbee_local& into) const;

    /// Reads or sets. Throws ise::error as the contract says. Cancellation: terminal, the modem may have executed it.
    ise::task<xbee_param> parameter(xbee_param_request request);

private:
    ise::task<xbee::at_outcome> ask(xbee::at_name name, ise::bytes parameter);

    struct asked {
        std::function<void(const xbee::at_outcome&)> done;
    };
    ise::loop& loop_;
    xbee::modem_port& port_;
    std::map<xbee::token, asked> asked_;
    std::map<xbee::at_name, std::uint64_t> values_;
};

} // namespace atirma
