#include "hosting.hpp"
#include "radio_key.hpp"

#include <components/boat/recall.hpp>
#include <components/gprs_link/gprs_link_emulator.hpp>
#include <components/gprs_proxy/gprs_gateway.hpp>
#include <components/gprs_proxy/gprs_proxy.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using ise::component_type;
using ise::parameter_kind;

// "ready: tcp://127.0.0.1:40112 udp://127.0.0.1:40112"
std::string ready(const std::vector<ise::endpoint>& listening) {
    std::string line = "ready:";
    for (const auto& at : listening) line += fmt::format(" {}", at.text());
    return line;
}

component_type gprs_proxy_type(const std::function<void(const std::string&)>& announce) {
    component_type type("gprs-proxy", "the boat over GPRS", "atirma/shore/gprs");
    auto options = std::make_shared<gprs_proxy_options>();
    options->on_listening = [announce](const std::vector<ise::endpoint>& listening) { announce(ready(listening)); };
    auto& set = type.parameters;
    set.add("boat-listen", options->listen,
            "endpoints for the boat: tls:// (requires certificates), tcp://, udp://; port 0: any free one")
        .kind(parameter_kind::endpoint);
    set.add("boat-id", options->shore.boat_id, "the boat's id; other logins are refused");
    set.add("store", options->store_at,
            "store that must have telemetry before the boat is acknowledged: atirma/communication");
    add_radio_key(set, options->radio_key_file, options->radio_secondary);
    set.add("database", options->database, "file with what was spent (SQLite); empty: counted since the start")
        .kind(parameter_kind::path);
    set.add("daily-budget", options->daily_budget, "bytes a day (UTC), both ways; needs database; 0: unlimited");
    set.add("monthly-budget", options->monthly_budget, "bytes a month (UTC), both ways; needs database; 0: unlimited");
    set.add("max-strangers", options->shore.max_strangers, "connections without a login").range(1, 1024);
    type.provides(services::telemetry)
        .provides(services::telecommand)
        .provides(services::telecommand_state)
        .provides(services::telecommand_recall)
        .provides(services::gprs);
    type.requires_(services::telemetry_store);
    type.make = [options] { return std::make_unique<gprs_proxy>(*options); };
    return type;
}

component_type gprs_gateway_type(const std::function<void(const std::string&)>& announce) {
    component_type type("gprs-gateway", "one address for the boats of a fleet over GPRS", "atirma/gprs");
    auto options = std::make_shared<gprs_gateway_options>();
    options->on_listening = [announce](const std::vector<ise::endpoint>& listening) { announce(ready(listening)); };
    auto& set = type.parameters;
    set.add("boat-listen", options->listen,
            "endpoints for the boats: tls:// (requires certificates), tcp://; port 0: any free one")
        .kind(parameter_kind::endpoint);
    set.add("proxy", options->proxy, "path of a boat's GPRS proxy; {boat} is the id in the boat's login");
    set.add("max-connections", options->max_connections, "connections of boats and of clients without a login")
        .range(1, 65536);
    type.provides(services::gprs_gateway).requires_(services::gprs);
    type.makes<gprs_gateway>(options);
    return type;
}

component_type gprs_link_type(const std::function<void(const std::string&)>& announce) {
    component_type type("gprs-link", "an emulated carrier between boat and proxy, with faults", "atirma/carrier");
    auto options = std::make_shared<gprs_link_options>();
    options->on_listening = [announce](const std::vector<ise::endpoint>& listening) { announce(ready(listening)); };
    auto& set = type.parameters;
    set.add("boat-listen", options->listen, "endpoints for the boat, tcp:// and udp://; port 0: any free one")
        .kind(parameter_kind::endpoint);
    set.add("proxy-tcp", options->proxy_tcp, "where connections are relayed: tcp://host:port")
        .kind(parameter_kind::url);
    set.add("proxy-udp", options->proxy_udp, "where datagrams are relayed: udp://host:port").kind(parameter_kind::url);
    set.add("delay", options->delay_s, "mean delay in each direction").range(0, 600).unit("s");
    set.add("jitter", options->jitter_s, "maximum that is added to the delay").range(0, 600).unit("s");
    set.add("loss", options->loss, "fraction of datagrams lost").range(0, 1);
    set.add("outage", options->outages, "outages of the network: START+LENGTH in seconds");
    set.add("seed", options->seed, "random seed of delay and loss");
    type.provides(services::carrier_control).provides(services::carrier);
    type.make = [options] { return std::make_unique<gprs_link_emulator>(*options); };
    return type;
}

} // namespace

std::vector<component_type> gprs_types(const std::function<void(const std::string&)>& announce) {
    std::vector<component_type> all;
    all.push_back(gprs_proxy_type(announce));
    all.push_back(gprs_gateway_type(announce));
    all.push_back(gprs_link_type(announce));
    return all;
}

} // namespace atirma
