#pragma once
#include <ise/component/component.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ise::mqtt {

/// A message to or from a broker. All properties but `retain` exist in MQTT 5 only.
struct message {
    std::string topic;
    std::string payload;
    bool retain = false;
    std::string content_type;
    std::string response_topic;
    std::string correlation; ///< any bytes
    std::optional<std::uint32_t> expiry_s;
    std::vector<std::pair<std::string, std::string>> user;
};

/// Where the broker is and how to log in.
struct broker_options {
    std::string url = "mqtt://127.0.0.1:1883"; ///< mqtt: 1883, mqtts: TLS, 8883
    bool version_5 = true;                     ///< else 3.1.1
    std::string client_id;
    std::string user;
    std::string password_file; ///< its first line
    std::string ca_file;       ///< PEM; empty: authorities of the system
    std::string certificate_file, key_file;
    duration keep_alive = std::chrono::seconds(15);
    duration connect_limit = std::chrono::seconds(20); ///< until the broker has accepted
    message will;                                      ///< published by the broker when the session ends
};

/// Callbacks of a session, on the component's loop. None may destroy the session.
struct session_events {
    std::function<void(message)> received;
    /// The broker has confirmed a message, or refused it: why, and whether to try the same one again later.
    std::function<void(int token, const std::optional<failure>& why, bool later)> confirmed;
    /// The broker has refused a subscription.
    std::function<void(const std::string& filter, const failure& why)> not_subscribed;
    std::function<void(const failure& why)> closed; ///< once, the last one
};

/// One connection to a broker, with a clean session: what is not confirmed when it ends has to be sent again. Its
/// destructor closes the connection without a farewell, so that the broker publishes the will. Used on its component's
/// loop.
class broker_session {
public:
    virtual ~broker_session() = default;
    /// Sends with QoS 1; a token for `confirmed`. Errors: too_large, invalid_argument (this message cannot be sent),
    /// peer_lost.
    virtual result<int> publish(const message& what) = 0;
    /// QoS 1, without messages that were retained before.
    virtual result<void> subscribe(const std::string& filter) = 0;
};

/// Connects and logs in. Errors: invalid_argument (the options, or a file that they name), unreachable, timed_out,
/// unauthorized (by the broker), refused. Cancellation: terminal.
using broker_connector = std::function<task<result<std::unique_ptr<broker_session>>>(
    component& self, broker_options options, session_events events)>;

/// By libmosquitto, on the loop of the component; names are looked up on another thread. Real world only:
/// invalid_argument in the virtual one.
task<result<std::unique_ptr<broker_session>>> connect_mosquitto(component& self, broker_options options,
                                                                session_events events);

} // namespace ise::mqtt
