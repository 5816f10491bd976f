#include "ocean.hpp"

#include <components/boat_simulator/services.hpp>

#include <support/catch.hpp>

#include <cstdlib>

using namespace std::chrono_literals;

ise::endpoint ocean::where(const std::string& host, std::uint16_t port) {
    return ise::endpoint{ise::protocol::tcp, host, port, {}};
}

ise::node_options ocean::quiet() {
    ise::node_options options;
    options.use_names = false;
    options.log = std::getenv("ISE_TEST_LOG") ? ise::log_to_stderr(ise::log_level::debug) : ise::log_sink();
    return options;
}

ise::component_options ocean::listening(std::uint16_t port) {
    ise::component_options options;
    options.listen = {where("0.0.0.0", port)};
    return options;
}

ocean::ocean(std::uint64_t seed) : world(seed) {
    static int number = 0;
    auto disk = "memory:ocean" + std::to_string(++number);
    disk_ = ise::database::open(disk, {}).value(); // holds it over the proxy's lives
    mails.options.later = [this](ise::duration after, std::function<void()> action) {
        world.after(after, std::move(action));
    };
    boat_options.gusts = false;
    boat_options.port.device.clear();
    boat_options.iridium.port.device = "/dev/ttyS2";
    boat_options.speedup = 0.1;         // a step of the model each second: hours pass quickly
    boat_options.iridium.period_s = 12; // of the model
    modem_options.gateway = "tcp://gateway:7421";
    modem_options.seed = seed;
    gateway_options.model.imeis = {modem_options.imei};
    gateway_options.model.seed = seed;
    gateway_options.post_to = "http://shore:7480/rockblock/mo";
    gateway_options.listen = "tcp://0.0.0.0:7481";
    proxy_options.imei = modem_options.imei;
    proxy_options.database = disk;
    proxy_options.webhook = "tcp://0.0.0.0:7480";
    proxy_options.gateway_addresses = "10.0.0.0/8"; // the virtual network
    proxy_options.rockblock.url = "http://gateway:7481/rockblock/MT";
    proxy_options.rockblock.username = "atirma";
    proxy_options.rockblock.password = "atirma";
}

void ocean::with_beacon() {
    beacon_options = modem_options;
    beacon_options->imei = "300234010753371";
    gateway_options.model.imeis.insert(beacon_options->imei);
    proxy_options.beacon_imei = beacon_options->imei;
    boat_options.beacon.device = "/dev/ttyS3";
    boat_options.beacon_period_s = 60; // of the model
}

atirma::scene ocean::set_scene(atirma::scene_request request) {
    std::optional<atirma::scene> scene;
    user([request, &scene](ise::component& self) -> ise::task<> {
        auto boat = boat_of(self);
        scene = co_await boat.call(atirma::services::scene_control, request, 5s);
    });
    REQUIRE(until([&] { return scene.has_value(); }));
    return *scene;
}

void ocean::start_modem(const std::string& port, std::uint16_t at, atirma::iridium_modem_options options) {
    world.host("sky").start_process("modem " + port, [=, this](ise::sim::process& here) -> std::shared_ptr<void> {
        auto wired = options;
        wired.open = [this, &here, port](ise::loop& on) {
            return world.serial_line(port, world.host("boat")).open_far_end(here, on);
        };
        auto node = std::make_shared<ise::node>(here, quiet());
        node->start<atirma::iridium_modem>("atirma/iridium/" + port, listening(at), std::move(wired));
        return node;
    });
}

void ocean::start() {
    start_modem("ttyS2", 7422, modem_options);
    if (beacon_options) start_modem("ttyS3", 7423, *beacon_options);
    world.host("gateway").start_process("gateway", [this](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quiet());
        node->start<atirma::iridium_gateway>("atirma/iridium/gateway", listening(7421), gateway_options);
        return node;
    });
    world.host("boat").start_process("boat", [this](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quiet());
        boat_component_ = &node->start<atirma::boat_simulator>("atirma/boat", listening(7413), boat_options);
        return node;
    });
    proxy_ = &world.host("shore").start_process("proxy", [this](ise::sim::process& here) -> std::shared_ptr<void> {
        auto terms = quiet();
        if (!terms.log) terms.log = log.sink();
        auto node = std::make_shared<ise::node>(here, terms);
        node->start<atirma::iridium_proxy>("atirma/shore/iridium", listening(7411), proxy_options);
        return node;
    });
}

void ocean::user(std::function<ise::task<>(ise::component&)> body) {
    world.host("console").start_process("user", [body](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quiet());
        ise::component_options asks_only;
        asks_only.listens = false;
        node->start("", body, asks_only);
        return node;
    });
}

ocean::watched& ocean::watch(bool telemetry) {
    auto& into = *watched_.emplace_back(std::make_unique<watched>());
    user([&into, telemetry](ise::component& self) -> ise::task<> {
        self.listen(proxy(self), atirma::services::telecommand_state,
                    [&into](const atirma::telecommand_status& state) { into.states.push_back(state); });
        self.listen(proxy(self), atirma::services::iridium_account,
                    [&into](const atirma::iridium_account& account) { into.account = account; });
        self.listen(gateway(self), atirma::services::iridium_gateway_status,
                    [&into](const atirma::iridium_gateway_state& state) { into.gateway = state; });
        self.listen(modem(self), atirma::services::iridium_sky,
                    [&into](const atirma::iridium_sky& state) { into.sky = state; });
        if (telemetry)
            self.listen(proxy(self), atirma::services::telemetry,
                        [&into](const atirma::telemetry_packet& packet) { into.telemetry.push_back(packet); });
        co_return;
    });
    return into;
}

void ocean::command(atirma::telecommand_request request, ise::duration deadline, asked& into) {
    user([request, deadline, &into](ise::component& self) -> ise::task<> {
        auto shore = proxy(self);
        into = co_await shore.try_call(atirma::services::telecommand, request, deadline);
    });
}

void ocean::set_gateway(atirma::iridium_gateway_request request) {
    bool done = false;
    user([request, &done](ise::component& self) -> ise::task<> {
        auto whom = gateway(self);
        auto response = co_await whom.try_call(atirma::services::iridium_gateway_control, request, 5s);
        response.value();
        done = true;
    });
    REQUIRE(until([&] { return done; }));
}

void ocean::set_sky(atirma::iridium_sky_request request) {
    bool done = false;
    user([request, &done](ise::component& self) -> ise::task<> {
        auto whom = modem(self);
        auto response = co_await whom.try_call(atirma::services::iridium_sky_control, request, 5s);
        response.value();
        done = true;
    });
    REQUIRE(until([&] { return done; }));
}
