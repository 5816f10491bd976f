#include "sea.hpp"

#include <cstdlib>

using namespace std::chrono_literals;

ise::endpoint sea::where(const std::string& host, std::uint16_t port) {
    return ise::endpoint{ise::protocol::tcp, host, port, {}};
}

ise::node_options sea::quiet() {
    ise::node_options options;
    options.use_names = false;
    options.log = std::getenv("ISE_TEST_LOG") ? ise::log_to_stderr(ise::log_level::debug) : ise::log_sink();
    return options;
}

ise::component_options sea::listening(std::uint16_t port) {
    ise::component_options options;
    options.listen = {where("0.0.0.0", port)};
    return options;
}

sea::sea(std::uint64_t seed, double speedup) : world(seed) {
    boat_options.speedup = speedup;
    boat_options.gusts = false;
    boat_options.port.device = "/dev/ttyS1";
    boat_options.port.baud = 115200;
    proxy_options.port.device = "/dev/ttyUSB0";
    proxy_options.port.baud = 115200;

    world.host("air").start_process("air", [this, speedup, seed](ise::sim::process& here) -> std::shared_ptr<void> {
        atirma::xbee_link_options options;
        options.speedup = speedup;
        options.seed = seed;
        options.boat_path = "tcp://boat:7413";
        options.shore.open = [this, &here](ise::loop& on) { return shore_line().open_far_end(here, on); };
        options.boat.open = [this, &here](ise::loop& on) {
            return world.serial_line("ttyS1", world.host("boat")).open_far_end(here, on);
        };
        auto node = std::make_shared<ise::node>(here, quiet());
        node->start<atirma::xbee_link_emulator>("atirma/air", listening(7412), std::move(options));
        return node;
    });
    world.host("boat").start_process("boat", [this](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quiet());
        boat_process_ = &here;
        boat_component_ = &node->start<atirma::boat_simulator>("atirma/boat", listening(7413), boat_options);
        return node;
    });
    world.host("shore").start_process("proxy", [this](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quiet());
        proxy_ = &here;
        node->start<atirma::xbee_proxy>("atirma/shore/xbee", listening(7411), proxy_options);
        return node;
    });
}

atirma::web_server& sea::start_page() {
    atirma::web_server* made = nullptr;
    world.host("page").start_process("page", [&made](ise::sim::process& here) -> std::shared_ptr<void> {
        atirma::web_server_options options;
        options.telemetry = {"tcp://shore:7411"};
        auto node = std::make_shared<ise::node>(here, quiet());
        made = &node->start<atirma::web_server>("atirma/page", listening(7414), std::move(options));
        return node;
    });
    return *made;
}

void sea::user(std::function<ise::task<>(ise::component&)> body) {
    world.host("console").start_process("user", [body](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quiet());
        ise::component_options asks_only;
        asks_only.listens = false;
        node->start("", body, asks_only);
        return node;
    });
}

sea::watched& sea::watch() {
    auto& into = *watched_.emplace_back(std::make_unique<watched>());
    user([&into](ise::component& self) -> ise::task<> {
        self.listen(proxy(self), atirma::services::telecommand_state,
                    [&into](const atirma::telecommand_status& state) { into.states.push_back(state); });
        self.listen(proxy(self), atirma::services::xb_local,
                    [&into](const atirma::xbee_local& local) { into.local = local; });
        auto shore = proxy(self);
        auto packets = co_await shore.subscribe(atirma::services::telemetry);
        for (;;) {
            auto packet = co_await packets.next();
            if (!packet) break;
            into.telemetry.push_back(*packet);
            if (auto lost = packet.lost_before()) into.lost += *lost;
            else ++into.unknown_gaps;
        }
    });
    return into;
}
