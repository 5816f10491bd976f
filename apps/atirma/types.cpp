#include "communication_types.hpp"
#include "foxglove_types.hpp"
#include "hosting.hpp"
#include "iridium_types.hpp"
#include "nmea_types.hpp"
#include "radio_key.hpp"

#include <components/boat/recall.hpp>
#include <components/boat_simulator/boat_simulator.hpp>
#include <components/boat_simulator/services.hpp>
#include <components/web_server/web_component.hpp>
#include <components/xbee_link/services.hpp>
#include <components/xbee_link/xbee_link_emulator.hpp>
#include <components/xbee_proxy/services.hpp>
#include <components/xbee_proxy/xbee_proxy.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using ise::component_type;
using ise::parameter_kind;

void add_address(ise::parameter_set& to, const std::string& name, std::uint64_t& into, const std::string& description) {
    auto now = fmt::format("{:016X}", into);
    to.add(name, into, description).kind(parameter_kind::hexadecimal).preset(now);
}

void add_port(ise::parameter_set& to, xbee::port_options& port) {
    to.add("serial", port.device, "serial port of the modem").kind(parameter_kind::path);
    to.add("baud", port.baud, "baud rate of that port").range(1200, 921600);
    to.add("rts-cts", port.hardware_flow_control, "hardware flow control");
}

component_type boat_simulator_type() {
    component_type type("boat-simulator", "a boat that sails in the bay of El Confital", "atirma/boat");
    auto options = std::make_shared<boat_simulator_options>();
    options->port.device.clear();
    auto& set = type.parameters;
    add_port(set, options->port);
    add_address(set, "shore-address", options->shore_address, "address of the shore's modem");
    set.add("course", options->course, "the course to sail").one_of({"T1", "T2", "none"});
    set.add("wind", options->wind_file,
            "recorded wind (CSV with t_s, tws_mps or tws_kn, twd_deg) instead of the one below")
        .kind(parameter_kind::path);
    set.add("wind-speed", options->wind_speed_mps, "mean speed of the wind").range(0, 40).unit("m/s").changeable();
    set.add("wind-from", options->wind_from_deg, "true direction from which the wind blows")
        .range(0, 360)
        .unit("degrees")
        .changeable();
    set.add("gusts", options->gusts, "gusts and shifts of the wind");
    set.add("iridium-serial", options->iridium.port.device, "serial port of its Iridium modem; empty: none")
        .kind(parameter_kind::path);
    set.add("iridium-period", options->iridium.period_s, "period of its telemetry over Iridium")
        .range(0.5, 86400)
        .unit("s");
    set.add("beacon-serial", options->beacon.device,
            "serial port of the second controller's own Iridium modem; empty: the boat has no second controller")
        .kind(parameter_kind::path);
    set.add("beacon-period", options->beacon_period_s, "period of the second controller's positions")
        .range(30, 86400)
        .unit("s");
    set.add("speedup", options->speedup, "factor of the boat's model time").range(0.1, 1000);
    set.add("seed", options->seed, "random seed of gusts and instruments");
    set.add("gprs", options->gprs, "GPRS proxy or carrier to connect to, tls://, tcp:// or udp:// (default: none)")
        .kind(parameter_kind::url);
    set.add("gprs-id", options->uplink.id, "its id at the GPRS proxy");
    set.add("gprs-period", options->gprs_period_s, "period of its telemetry over GPRS; 0: none")
        .range(0, 86400)
        .unit("s");
    set.add("gprs-memory", options->uplink.capacity, "capacity of its memory for unacknowledged packets").range(1, 1e6);
    set.add("memory", options->memory_file, "file with its state over a loss of power (SQLite); empty: no memory")
        .kind(parameter_kind::path);
    set.add("radio-key", options->radio_key_file,
            "file of the radio's key (atirma keys new): the boat then refuses what is not sealed; empty: it obeys "
            "everybody on its links")
        .kind(parameter_kind::path);
    set.add("fence", options->fence_file, "GeoJSON file of the area that it does not leave; empty: none")
        .kind(parameter_kind::path);
    set.add("coast", options->keeps_off_coast, "turns back before the coast");
    set.add("raw-telecommands", options->raw_telecommands, "gives the bytes of raw telecommands to its controller");
    set.add("clock-off", options->clock_off_s,
            "error of the boat's clock, which is then not set by GPS; 0: GPS sets it")
        .range(-86400, 86400)
        .unit("s");
    set.add("boot", options->boot, "number of this boot; 0: random, or the last one plus one if it has a memory");
    type.provides(services::scene_control).provides(services::truth);
    type.makes<boat_simulator>(options);
    return type;
}

component_type xbee_link_type() {
    component_type type("xbee-link", "two emulated modems and the air between them", "atirma/air");
    auto options = std::make_shared<xbee_link_options>();
    options->boat_path = "atirma/boat";
    auto& set = type.parameters;
    set.add("shore-port", options->shore.port, "link to the shore modem's serial port").kind(parameter_kind::path);
    set.add("boat-port", options->boat.port, "link to the boat modem's serial port").kind(parameter_kind::path);
    set.add("shore-api", options->shore.api_mode, "the shore modem's API mode").range(0, 2);
    set.add("boat-api", options->boat.api_mode, "the boat modem's API mode").range(0, 2);
    set.add("boat", options->boat_path, "component whose ground_truth has the boat's position");
    set.add("distance", options->distance_m, "distance between the modems until the boat's position is known")
        .range(1, 100000)
        .unit("m");
    set.add("loss", options->extra_loss, "fraction of packets lost at any distance").range(0, 1).changeable();
    set.add("speedup", options->speedup, "factor of the air's model time").range(0.1, 1000);
    set.add("seed", options->seed, "random seed of loss and back-off");
    type.provides(services::air_control).provides(services::air).requires_(services::truth);
    type.makes<xbee_link_emulator>(options);
    return type;
}

component_type xbee_proxy_type() {
    component_type type("xbee-proxy", "the boat over the XBee radio", "atirma/shore/xbee");
    auto options = std::make_shared<xbee_proxy_options>();
    add_port(type.parameters, options->port);
    add_address(type.parameters, "boat-address", options->boat_address, "address of the boat's modem; 0: any modem");
    type.parameters.add(
        "store", options->store_at,
        "store that must have telemetry before the boat gets a receipt: atirma/communication; empty: no receipts");
    add_radio_key(type.parameters, options->radio_key_file, options->radio_secondary);
    type.provides(services::telemetry)
        .provides(services::telecommand)
        .provides(services::telecommand_state)
        .provides(services::telecommand_recall);
    type.provides(services::xb_local).provides(services::xb_local_param);
    type.requires_(services::telemetry_store);
    type.makes<xbee_proxy>(options);
    return type;
}

component_type web_server_type(std::function<void(const std::string&)> announce) {
    component_type type("web-server", "the public tracking page", "atirma/page");
    auto options = std::make_shared<web_server_options>();
    options->telemetry = {"atirma/shore/xbee", "atirma/shore/gprs"};
    options->on_listening = [announce](const std::string& url) { announce("ready: " + url); };
    auto& set = type.parameters;
    set.add("address", options->http.address, "numeric address to listen on").kind(parameter_kind::address);
    set.add("port", options->http.port, "port to listen on; 0: any free one").port_at("address");
    set.add("telemetry", options->telemetry,
            "sources of telemetry: paths of proxies, or the role atirma/communication");
    set.add("boat-name", options->track.boat, "name of the boat on the page");
    set.add("more-boats", options->more_boats, "further boats, each NAME=PATH[,PATH], such as Vela=vela/communication");
    set.add("boats", options->boats, "boats of the fleet: the first, boat-2, boat-3..., each by its communication node")
        .range(1, 1000);
    set.add("archive", options->archive.file, "SQLite file for track and telemetry, kept over a restart; empty: none")
        .kind(parameter_kind::path);
    set.add("tiles", options->tiles.url,
            "address of map tiles that browsers load, with {z}, {x} and {y}; empty: only the page's own coastline");
    set.add("tile-attribution", options->tiles.attribution, "shown beside the map, as the tiles' licence asks");
    type.requires_(services::telemetry);
    type.makes<web_server>(options);
    return type;
}

} // namespace

std::vector<component_type> component_types(std::function<void(const std::string&)> announce) {
    std::vector<component_type> all;
    all.push_back(boat_simulator_type());
    all.push_back(xbee_link_type());
    all.push_back(xbee_proxy_type());
    for (auto& type : gprs_types(announce)) all.push_back(std::move(type));
    add_iridium_types(all);
    all.push_back(nmea_bridge_type(announce));
    all.push_back(foxglove_gateway_type(announce));
    all.push_back(web_server_type(std::move(announce)));
    all.push_back(communication_node_type());
    return all;
}

} // namespace atirma
