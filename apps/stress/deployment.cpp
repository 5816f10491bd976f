// Who runs where: the deployment of the paper.
#include "tapped_stream.hpp"
#include "voyage.hpp"
#include "wire_relay.hpp"

#include <components/gprs_link/gprs_link_emulator.hpp>
#include <components/gprs_proxy/gprs_proxy.hpp>
#include <components/gui_client/gui_client.hpp>
#include <components/iridium_gateway/iridium_gateway.hpp>
#include <components/iridium_modem/iridium_modem.hpp>
#include <components/iridium_proxy/iridium_proxy.hpp>
#include <components/xbee_link/xbee_link_emulator.hpp>
#include <components/xbee_proxy/xbee_proxy.hpp>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr const char* boat_path = "atirma/boat";

/// The far end of a serial line, with somebody who reads along.
ise::result<std::unique_ptr<ise::stream>> open_tapped(ise::sim::serial_line& line, ise::sim::process& owner,
                                                      ise::loop& on, std::unique_ptr<tap> by) {
    auto opened = line.open_far_end(owner, on);
    if (!opened) return opened;
    return tapped_far_end(std::move(*opened), std::move(by));
}

/// Reads along only while somebody is at the device: what a modem says to a port that nobody has open is lost on the
/// wire.
class attended final : public tap {
public:
    attended(std::unique_ptr<tap> by, std::function<bool()> somebody)
        : by_(std::move(by)), somebody_(std::move(somebody)) {}
    void wrote(ise::bytes_view bytes) override { by_->wrote(bytes); }
    void read(ise::bytes_view bytes) override {
        if (somebody_()) by_->read(bytes);
    }

private:
    std::unique_ptr<tap> by_;
    std::function<bool()> somebody_;
};

} // namespace

void voyage::start_sea() {
    auto time = [this] { return world_.elapsed(); };
    start("atirma/air", "sea", [this, time](ise::node& node, ise::component_options where) -> ise::component& {
        xbee_link_options options;
        options.seed = options_.seed;
        options.boat_path = boat_path;
        auto& env = static_cast<ise::sim::process&>(node.env());
        options.shore.open = [this, &env, time](ise::loop& on) {
            auto somebody = [this] { return places_["atirma/shore/xbee"].component != nullptr; };
            return open_tapped(world_.serial_line("ttyUSB0", world_.host("beach")), env, on,
                               std::make_unique<attended>(tap_shore_xbee(book_, time), somebody));
        };
        options.boat.open = [this, &env, time](ise::loop& on) {
            return open_tapped(world_.serial_line("ttyS1", world_.host("boat")), env, on, tap_boat_xbee(book_, time));
        };
        return node.start<xbee_link_emulator>("atirma/air", std::move(where), std::move(options));
    });
    start("atirma/carrier", "carrier", [this](ise::node& node, ise::component_options where) -> ise::component& {
        gprs_link_options options;
        options.listen = {"tcp://0.0.0.0:7430", "udp://0.0.0.0:7430"};
        options.proxy_tcp = "tcp://links:7420";
        options.proxy_udp = "udp://links:7420";
        options.seed = options_.seed;
        return node.start<gprs_link_emulator>("atirma/carrier", std::move(where), std::move(options));
    });
    start("atirma/iridium/gateway", "gateway",
          [this](ise::node& node, ise::component_options where) -> ise::component& {
              iridium_gateway_options options;
              options.model.imeis = {iridium_modem_options().imei};
              options.model.seed = options_.seed;
              options.model.max_repeat = 2min;
              options.duplicates = 0.05;
              options.delivery_delay_s = 20;
              options.post_to = "http://links:7480/rockblock/mo";
              options.listen = "tcp://0.0.0.0:7481";
              return node.start<iridium_gateway>("atirma/iridium/gateway", std::move(where), std::move(options));
          });
    start(
        "atirma/iridium/modem", "sky", [this, time](ise::node& node, ise::component_options where) -> ise::component& {
            iridium_modem_options options;
            options.min_session_s = 10;
            options.max_session_s = 40;
            options.failures = 0.1;
            options.seed = options_.seed;
            auto& env = static_cast<ise::sim::process&>(node.env());
            options.open = [this, &env, time](ise::loop& on) {
                return open_tapped(world_.serial_line("ttyS2", world_.host("boat")), env, on, tap_iridium(book_, time));
            };
            return node.start<iridium_modem>("atirma/iridium/modem", std::move(where), std::move(options));
        });
    start("atirma/boat/wire", "boat", [this, time](ise::node& node, ise::component_options where) -> ise::component& {
        auto tap = [this, time] { return tap_gprs(book_, time, numbers_); };
        node.start<datagram_wire>("atirma/boat/datagrams", where, "udp://0.0.0.0:7431", "udp://carrier:7430", tap);
        return node.start<wire_relay>("atirma/boat/wire", std::move(where), "tcp://0.0.0.0:7431", "tcp://carrier:7430",
                                      tap);
    });
    if (!options_.wind_csv.empty()) world_.host("boat").write_file("/wind.csv", options_.wind_csv);
    start(boat_path, "boat", [this](ise::node& node, ise::component_options where) -> ise::component& {
        boat_simulator_options options;
        options.course = "T1";
        if (!options_.wind_csv.empty()) options.wind_file = "/wind.csv";
        options.wind_speed_mps = told_.plan.wind_speed_mps;
        options.wind_from_deg = told_.plan.wind_from_deg;
        options.seed = options_.seed;
        options.port.device = "/dev/ttyS1";
        options.port.baud = 115200;
        options.iridium.port.device = "/dev/ttyS2";
        options.iridium.period_s = told_.plan.iridium_period_s;
        options.memory_file = disk_prefix_ + "boat";
        options.on_executed = [this](const acknowledgement& done) {
            executed_command one;
            one.id = done.id;
            one.kind = done.kind;
            one.at = done.header.measured_at - told_.began; // the boat's clock is right
            told_.executed.push_back(one);
        };
        options.gprs = boat_lives_++ % 2 == 0 ? "tcp://boat:7431" : "udp://boat:7431"; // the relay
        return node.start<boat_simulator>(boat_path, std::move(where), std::move(options));
    });
}

void voyage::start_shore() {
    start("atirma/shore/xbee", "beach", [](ise::node& node, ise::component_options where) -> ise::component& {
        xbee_proxy_options options;
        options.store_at = std::string(communication_role);
        options.port.device = "/dev/ttyUSB0";
        options.port.baud = 115200;
        return node.start<xbee_proxy>("atirma/shore/xbee", std::move(where), std::move(options));
    });
    start("atirma/shore/gprs", "links", [](ise::node& node, ise::component_options where) -> ise::component& {
        gprs_proxy_options options;
        options.listen = {"tcp://0.0.0.0:7420", "udp://0.0.0.0:7420"};
        options.store_at = std::string(communication_role); // the boat is acknowledged for what is on the nodes' disks
        return node.start<gprs_proxy>("atirma/shore/gprs", std::move(where), std::move(options));
    });
    start("atirma/shore/iridium", "links", [this](ise::node& node, ise::component_options where) -> ise::component& {
        iridium_proxy_options options;
        options.imei = iridium_modem_options().imei;
        options.database = disk_prefix_ + "iridium";
        options.store_at = std::string(communication_role);
        options.webhook = "tcp://0.0.0.0:7480";
        options.gateway_addresses = "10.0.0.0/8"; // the virtual network
        options.rockblock.url = "http://gateway:7481/rockblock/MT";
        options.rockblock.username = "atirma";
        options.rockblock.password = "atirma";
        options.daily_budget = 0;
        return node.start<iridium_proxy>("atirma/shore/iridium", std::move(where), std::move(options));
    });
    for (int which = 1; which <= 2; ++which) {
        auto path = "atirma/shore/node-" + std::to_string(which);
        start(path, which == 1 ? "shore" : "backup",
              [this, which, path](ise::node& node, ise::component_options where) -> ise::component& {
                  communication_node_options options;
                  options.file = disk_prefix_ + "node-" + std::to_string(which);
                  options.secondary = which == 2;
                  options.peer = which == 1 ? "atirma/shore/node-2" : "atirma/shore/node-1";
                  options.proxies = {{link_id::xbee, "atirma/shore/xbee"},
                                     {link_id::gprs, "atirma/shore/gprs"},
                                     {link_id::iridium, "atirma/shore/iridium"}};
                  return node.start<communication_node>(path, std::move(where), std::move(options));
              });
    }
}

void voyage::start_people() {
    start("atirma/page", "web", [](ise::node& node, ise::component_options where) -> ise::component& {
        web_server_options options;
        options.telemetry = {std::string(communication_role)};
        return node.start<web_server>("atirma/page", std::move(where), std::move(options));
    });
    for (std::size_t i = 0; i < operators; ++i) start_operator(i);
    start("script", "script", [this](ise::node& node, ise::component_options where) -> ise::component& {
        director_ = &node.start<director>("script", std::move(where));
        return *director_;
    });
}

/// A console, and who sits at it.
void voyage::start_operator(std::size_t which) {
    const auto& name = told_.people[which].name;
    start("atirma/console/" + name, name,
          [this, which, name](ise::node& node, ise::component_options where) -> ise::component& {
              console::gui_client_options options;
              options.name_servers = {ise::endpoint::parse("tcp://names:7400").value()};
              options.tick = 1s;
              options.max_quiet = 5s;
              consoles_[which] = options.port;
              node.start<console::gui_client>("atirma/console/" + name, where, options);
              return node.start<operator_seat>(
                  "atirma/desk/" + name, std::move(where), told_.people[which], book_,
                  [this] { return world_.elapsed(); }, options.port);
          });
}

} // namespace atirma::stress
