#pragma once
#include <components/gui_client/authority_client.hpp>
#include <components/gui_client/client_context.hpp>
#include <components/gui_client/operator_port.hpp>

#include <map>
#include <optional>
#include <set>
#include <string>

namespace atirma::console {

/// Sends telecommands, and repeats each under its id until it is decided or its time is over. The boat executes an id
/// once: repeating is safe, also after a proxy was lost.
class telecommand_sender {
public:
    telecommand_sender(client_context& context, authority_client& authority)
        : context_(context), authority_(authority) {}

    /// Sends one, and returns what became of it. `stop`: once that is true it is given up, and may still be executed;
    /// returns within two seconds then. Cancellation: terminal.
    ise::task<command_phase> execute(give_command what, const bool* stop = nullptr);

    /// Shows it as refused; it is not sent.
    void refuse(const give_command& what, std::string why);
    /// Calls one back: asks the node or proxy that has it, and does not give it any more. Cancellation: terminal.
    ise::task<> call_back(std::uint32_t id, std::string why = "by its operator");

private:
    /// Calls back those of its own that are open and whose place the newer one takes.
    void replace_older(std::uint32_t by, const boat_command& newer);
    /// Why it takes an override of the operator; empty: it does not.
    std::string limits_forbid(const give_command& what) const;
    /// The component that gets it; sets `request.via` where the communication nodes choose the link.
    std::string route(const std::string& via, telecommand_request& request) const;
    float default_valid_s(command_kind kind, const std::string& via) const;
    ise::task<command_phase> repeat(std::string to, telecommand_request request, ise::time_point expires,
                                    const bool* stop);
    command_phase settle(std::uint32_t id, command_phase phase, std::string text,
                         std::optional<float> value = std::nullopt);

    client_context& context_;
    authority_client& authority_;
    std::map<std::uint32_t, boat_command> open_; ///< not decided yet
    std::set<std::uint32_t> called_back_;
};

} // namespace atirma::console
