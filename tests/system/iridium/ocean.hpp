#pragma once
#include <components/boat_simulator/boat_simulator.hpp>
#include <components/iridium_gateway/iridium_gateway.hpp>
#include <components/iridium_modem/iridium_modem.hpp>
#include <components/iridium_modem/services.hpp>
#include <components/iridium_proxy/iridium_proxy.hpp>
#include <components/iridium_proxy/services.hpp>
#include <components/mail/memory_mail.hpp>

#include <ise/component/node.hpp>
#include <ise/database/database.hpp>
#include <ise/sim/world.hpp>

#include <support/damaged_file.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

/// The whole of Iridium on the virtual clock: the boat with its modem's serial line, the modem, the gateway and the
/// proxy, each on a host of its own. The proxy's disk outlives it. Components are the unmodified ones.
class ocean {
public:
    explicit ocean(std::uint64_t seed = 7);

    atirma::memory_mail mails;   // outlives those who have opened it
    damaged_file::log_lines log; // the proxy's errors
    ise::sim::world world;
    atirma::boat_simulator_options boat_options;
    atirma::iridium_modem_options modem_options;
    std::optional<atirma::iridium_modem_options> beacon_options; ///< of the second controller's modem; nothing: none
    atirma::iridium_gateway_options gateway_options;
    atirma::iridium_proxy_options proxy_options;

    /// The boat gets a second controller with a modem of its own; before the start.
    void with_beacon();
    /// Changes the scene around the boat; returns it.
    atirma::scene set_scene(atirma::scene_request request);
    /// Starts everything, with the options as they are then.
    void start();
    bool until(const std::function<bool()>& done, ise::duration within = std::chrono::minutes(30)) {
        return world.run_until(done, within);
    }

    ise::sim::process& proxy_process() { return *proxy_; }
    const atirma::simulator::simulated_boat& boat() const { return *boat_component_->boat(); }
    ise::database& disk() { return *disk_; }

    /// Runs a coroutine as a component of its own on the host "console".
    void user(std::function<ise::task<>(ise::component&)> body);
    static ise::remote proxy(ise::component& self) { return self.at(where("shore", 7411)); }
    static ise::remote gateway(ise::component& self) { return self.at(where("gateway", 7421)); }
    static ise::remote boat_of(ise::component& self) { return self.at(where("boat", 7413)); }
    static ise::remote modem(ise::component& self) { return self.at(where("sky", 7422)); }
    static ise::endpoint where(const std::string& host, std::uint16_t port);

    /// Every packet and state that the console was told since it was asked to watch.
    struct watched {
        std::vector<atirma::telemetry_packet> telemetry;
        std::vector<atirma::telecommand_status> states;
        std::optional<atirma::iridium_account> account;
        std::optional<atirma::iridium_gateway_state> gateway;
        std::optional<atirma::iridium_sky> sky;
    };
    watched& watch(bool telemetry = true);

    using asked = std::optional<ise::result<atirma::telecommand_reply>>;
    void command(atirma::telecommand_request request, ise::duration deadline, asked& into);
    void set_gateway(atirma::iridium_gateway_request request);
    void set_sky(atirma::iridium_sky_request request);

private:
    void start_modem(const std::string& port, std::uint16_t at, atirma::iridium_modem_options options);
    static ise::node_options quiet();
    static ise::component_options listening(std::uint16_t port);

    std::optional<ise::database> disk_;
    ise::sim::process* proxy_ = nullptr;
    atirma::boat_simulator* boat_component_ = nullptr;
    std::vector<std::unique_ptr<watched>> watched_;
};
