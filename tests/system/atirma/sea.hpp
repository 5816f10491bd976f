#pragma once
#include <components/boat_simulator/boat_simulator.hpp>
#include <components/web_server/web_component.hpp>
#include <components/xbee_link/xbee_link_emulator.hpp>
#include <components/xbee_proxy/xbee_proxy.hpp>

#include <ise/component/node.hpp>
#include <ise/sim/world.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

inline atirma::telecommand_request set_mode(std::uint32_t id, atirma::sailing_mode mode) {
    atirma::telecommand_request request;
    request.id = id;
    request.command = atirma::commands::set_mode{mode};
    request.valid_s = 300;
    return request;
}

/// The whole slice on the virtual clock: the boat on one host, the proxy on another, two emulated modems and the air
/// between their serial lines on a third. Components are the unmodified ones.
class sea {
public:
    explicit sea(std::uint64_t seed = 7, double speedup = 1);

    ise::sim::world world;
    atirma::boat_simulator_options boat_options;
    atirma::xbee_proxy_options proxy_options;

    /// Runs until `done`; false if that did not come within so much virtual time.
    bool until(const std::function<bool()>& done, ise::duration within = std::chrono::minutes(2)) {
        return world.run_until(done, within);
    }

    ise::sim::process& proxy_process() { return *proxy_; }
    ise::sim::process& boat_process() { return *boat_process_; }
    const atirma::boat_simulator& boat_component() const { return *boat_component_; }
    const atirma::simulator::simulated_boat& boat() const { return *boat_component_->boat(); }
    ise::sim::serial_line& shore_line() { return world.serial_line("ttyUSB0", world.host("shore")); }

    /// Starts a page without HTTP; valid until its process ends.
    atirma::web_server& start_page();
    /// Runs a coroutine as a component of its own on the host "console".
    void user(std::function<ise::task<>(ise::component&)> body);
    /// The services of the proxy, the air and the boat, as a component of another host reaches them.
    static ise::remote proxy(ise::component& self) { return self.at(where("shore", 7411)); }
    static ise::remote air(ise::component& self) { return self.at(where("air", 7412)); }
    static ise::remote boat_of(ise::component& self) { return self.at(where("boat", 7413)); }
    static ise::endpoint where(const std::string& host, std::uint16_t port);

    /// Every packet and every state that the console was told since it was asked to watch.
    struct watched {
        std::vector<atirma::telemetry_packet> telemetry;
        std::uint64_t lost = 0, unknown_gaps = 0;
        std::vector<atirma::telecommand_status> states;
        std::optional<atirma::xbee_local> local;
    };
    watched& watch();

    static ise::node_options quiet();
    static ise::component_options listening(std::uint16_t port);

private:
    ise::sim::process* proxy_ = nullptr;
    ise::sim::process* boat_process_ = nullptr;
    atirma::boat_simulator* boat_component_ = nullptr;
    std::vector<std::unique_ptr<watched>> watched_;
};
