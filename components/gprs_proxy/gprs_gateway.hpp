#pragma once
#include <components/boat/packet_header.hpp>

#include <ise/component/component.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/net/bounded_acceptor.hpp>

#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

/// A connection of a boat that the gateway relays.
struct gprs_call {
    std::string boat; ///< by its login
    std::string from; ///< its address: "tcp://10.64.0.9:40112"
    utc_time since{};
};
/// State of the gateway, published every two seconds.
struct gprs_gateway_state {
    std::vector<std::string> listening; ///< endpoints that the boats can call
    std::vector<gprs_call> calls;
    std::uint64_t logins = 0;  ///< connections that were relayed
    std::uint64_t refused = 0; ///< connections that were closed: no login, no such boat, no place
    std::string trouble;       ///< why the last of these was closed
};

struct gprs_gateway_options {
    std::vector<std::string> listen{"tcp://127.0.0.1:7419"}; ///< where boats call, tcp or tls; port 0: any free one
    std::string proxy = "{boat}/shore/gprs";             ///< path of a boat's GPRS proxy; {boat}: the id in its login
    ise::duration login_time = std::chrono::seconds(10); ///< for the login, and again for reaching the proxy
    std::size_t max_connections = 1024; ///< of boats and of those who have not logged in; then fair_places decides
    std::function<void(const std::vector<ise::endpoint>&)> on_listening; ///< on the component's loop
};

namespace services {
inline constexpr ise::subscription<gprs_gateway_state> gprs_gateway{"gprs_gateway_state"};
} // namespace services

/// One address for the boats of a fleet: reads the login of each connection, which names the boat, and relays it to
/// that boat's GPRS proxy, which listens on tcp for the gateway. It changes no byte: numbers, seal, receipts and
/// telecommands are between a boat and its own proxy. Connections that name no boat, or one without a proxy, are closed
/// and counted. Service: `gprs_gateway_state`. An endpoint that is neither tcp nor tls, or is taken, ends `run()` with
/// an error.
class gprs_gateway final : public ise::component {
public:
    explicit gprs_gateway(gprs_gateway_options options = gprs_gateway_options());
    ~gprs_gateway() override;

private:
    struct call;

    ise::task<> run() override;
    ise::endpoint open(const ise::endpoint& at);
    void take(ise::net::admitted who);
    ise::task<> carry(std::shared_ptr<call> of);
    ise::task<std::optional<std::string>> read_login(std::shared_ptr<call> of);
    ise::task<ise::result<std::unique_ptr<ise::stream>>> reach(std::string boat);
    ise::task<> pump(std::shared_ptr<call> of, bool up);
    void refuse(call& of, const std::string& why);
    void end(call& of);
    gprs_gateway_state state() const;

    gprs_gateway_options options_;
    std::optional<ise::net::fair_places> places_; // before the calls, which hold them
    std::list<std::shared_ptr<call>> calls_;
    ise::log_limiter refusals_;
    gprs_gateway_state counts_;
};

} // namespace atirma
