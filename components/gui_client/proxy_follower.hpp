#pragma once
#include <components/gui_client/followed_stream.hpp>

#include <map>
#include <set>
#include <string>

namespace atirma::console {

/// Follows what proxies publish: telemetry, the states of telecommands, and what each knows of its link.
class proxy_follower {
public:
    explicit proxy_follower(client_context& context) : context_(context) {}

    /// The services that it follows.
    static const std::set<std::string>& followed_services();
    /// Subscribes to those of `provided` that it follows and did not before.
    void follow(const std::string& path, const std::set<std::string>& provided);
    /// Reports to the state which proxies are reached.
    void report();

private:
    void follow_telemetry(const std::string& path);
    /// The newest value, as long as the proxy provides it.
    template <class Contract>
    void follow_newest(const std::string& path, const Contract& service,
                       void (console_state::*on_value)(const std::string&, const typename Contract::packet_type&,
                                                       utc_time));

    client_context& context_;
    std::map<std::string, std::set<std::string>> followed_; ///< by path: the services
    std::map<std::string, stream_health> telemetry_;        ///< by path
};

/// Follows the states of all telecommands that the component at `path` knows, from now on.
void follow_telecommands(client_context& context, const std::string& path);

} // namespace atirma::console
