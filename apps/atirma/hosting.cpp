#include "hosting.hpp"

#include <components/boat_simulator/boat_simulator.hpp>
#include <components/web_server/web_component.hpp>
#include <components/xbee_link/xbee_link_emulator.hpp>
#include <components/xbee_proxy/xbee_proxy.hpp>

#include <CLI/CLI.hpp>

namespace atirma {
namespace {

using announcer = std::function<void(const std::string&)>;

CLI::Validator hexadecimal_address() {
    return CLI::Validator(
        [](std::string& text) -> std::string {
            char* end = nullptr;
            if (text.empty() || text.size() > 16 || text[0] == '-' || text[0] == '+') return "an address is up to 16 hexadecimal digits, such as 0013A20040000002";
            auto number = std::strtoull(text.c_str(), &end, 16);
            if (*end != '\0') return "an address is up to 16 hexadecimal digits, such as 0013A20040000002";
            text = std::to_string(number);
            return {};
        },
        "HEX");
}

/// What every component has; its place is `into` once it was named.
CLI::App* add(CLI::App& run, std::vector<hosted>& into, const std::string& name, const std::string& what, const std::string& path,
              std::function<std::unique_ptr<ise::component>()> make) {
    auto* sub = run.add_subcommand(name, what);
    auto made = std::make_shared<hosted>();
    made->path = path;
    made->make = std::move(make);
    sub->add_option("--path", made->path, "its name in the system")->capture_default_str();
    sub->add_option("--listen", made->listen, "endpoints it listens on, such as tcp://0.0.0.0:7411 (default: in-process, local, loopback)")->allow_extra_args(false);
    sub->add_option("--advertise", made->advertise, "further endpoints it is reached by")->allow_extra_args(false);
    sub->final_callback([made, &into] { into.push_back(*made); });
    return sub;
}

void add_port(CLI::App& to, xbee::port_options& port) {
    to.add_option("--serial", port.device, "serial port of the modem")->capture_default_str();
    to.add_option("--baud", port.baud, "of that port")->check(CLI::Range(1200u, 921600u))->capture_default_str();
    to.add_flag("--rts-cts", port.hardware_flow_control, "hardware flow control");
}

void add_xbee_proxy(CLI::App& run, std::vector<hosted>& into) {
    auto options = std::make_shared<xbee_proxy_options>();
    auto* sub = add(run, into, "xbee-proxy", "the boat over the XBee radio", "atirma/shore/xbee", [options] { return std::make_unique<xbee_proxy>(*options); });
    add_port(*sub, options->port);
    sub->add_option("--boat-address", options->boat_address, "of the boat's modem; 0: whoever is heard")->transform(hexadecimal_address())->default_str("0013A20040000002");
}

void add_boat_simulator(CLI::App& run, std::vector<hosted>& into) {
    auto options = std::make_shared<boat_simulator_options>();
    options->port.device.clear();
    auto* sub = add(run, into, "boat-simulator", "a boat that sails in the bay of El Confital", "atirma/boat", [options] { return std::make_unique<boat_simulator>(*options); });
    add_port(*sub, options->port);
    sub->add_option("--shore-address", options->shore_address, "of the shore's modem")->transform(hexadecimal_address())->default_str("0013A20040000001");
    sub->add_option("--course", options->course, "what it sails")->check(CLI::IsMember({"T1", "T2", "none"}))->capture_default_str();
    auto* file = sub->add_option("--wind", options->wind_file, "recorded wind (CSV with t_s, tws_mps or tws_kn, twd_deg)")->check(CLI::ExistingFile);
    sub->add_option("--wind-speed", options->wind_speed_mps, "m/s")->check(CLI::Range(0.0, 40.0))->capture_default_str()->excludes(file);
    sub->add_option("--wind-from", options->wind_from_deg, "true direction it comes from, degrees")->check(CLI::Range(0.0, 360.0))->capture_default_str()->excludes(file);
    sub->add_flag("--gusts,!--steady", options->gusts, "gusts and shifts, or none");
    sub->add_option("--speedup", options->speedup, "of the boat's model time")->check(CLI::Range(0.1, 1000.0))->capture_default_str();
    sub->add_option("--seed", options->seed, "of gusts and instruments")->capture_default_str();
    sub->add_option("--boot", options->boot, "number of this life of the boat; 0: from the clock")->capture_default_str();
}

void add_xbee_link(CLI::App& run, std::vector<hosted>& into) {
    auto options = std::make_shared<xbee_link_options>();
    options->boat_path = "atirma/boat";
    auto* sub = add(run, into, "xbee-link", "two emulated modems and the air between them", "atirma/air", [options] { return std::make_unique<xbee_link_emulator>(*options); });
    sub->add_option("--shore-port", options->shore.port, "link to the shore modem's serial port")->capture_default_str();
    sub->add_option("--boat-port", options->boat.port, "link to the boat modem's serial port")->capture_default_str();
    sub->add_option("--shore-api", options->shore.api_mode, "its API mode")->check(CLI::Range(0, 2))->capture_default_str();
    sub->add_option("--boat-api", options->boat.api_mode, "its API mode")->check(CLI::Range(0, 2))->capture_default_str();
    sub->add_option("--boat", options->boat_path, "whose ground_truth tells where the boat is")->capture_default_str();
    sub->add_option("--distance", options->distance_m, "metres, until that is known")->check(CLI::Range(1.0, 100000.0))->capture_default_str();
    sub->add_option("--loss", options->extra_loss, "part of the packets that is lost at any distance")->check(CLI::Range(0.0, 1.0))->capture_default_str();
    sub->add_option("--speedup", options->speedup, "of the air's model time")->check(CLI::Range(0.1, 1000.0))->capture_default_str();
    sub->add_option("--seed", options->seed, "of loss and back-off")->capture_default_str();
}

void add_web_server(CLI::App& run, std::vector<hosted>& into, const announcer& announce) {
    auto options = std::make_shared<web_server_options>();
    options->telemetry = {"atirma/shore/xbee"};
    options->on_listening = [announce](const std::string& url) { announce("ready: " + url); };
    auto* sub = add(run, into, "web-server", "the public tracking page", "atirma/page", [options] { return std::make_unique<web_server>(*options); });
    sub->add_option("--address", options->http.address, "to listen on, numeric")->capture_default_str();
    sub->add_option("--port", options->http.port, "to listen on; 0: any free one")->capture_default_str();
    sub->add_option("--telemetry", options->telemetry, "paths of the proxies to show")->allow_extra_args(false)->capture_default_str();
    sub->add_option("--boat-name", options->track.boat, "on the page")->capture_default_str();
}

} // namespace

void add_components(CLI::App& run, std::vector<hosted>& into, announcer announce) {
    add_boat_simulator(run, into);
    add_xbee_link(run, into);
    add_xbee_proxy(run, into);
    add_web_server(run, into, announce);
}

} // namespace atirma
