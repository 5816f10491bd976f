#include "gprs_sea.hpp"

#include <support/catch.hpp>

using namespace std::chrono_literals;

gprs_sea::gprs_sea(const std::string& protocol, std::uint64_t seed) : sea(seed) {
    gprs_options.listen = {"tcp://0.0.0.0:7420", "udp://0.0.0.0:7420"};
    carrier_options.listen = {"tcp://0.0.0.0:7421", "udp://0.0.0.0:7421"};
    carrier_options.proxy_tcp = "tcp://shore:7420";
    carrier_options.proxy_udp = "udp://shore:7420";
    carrier_options.seed = seed;
    gprs_ = &world.host("shore").start_process("gprs", [this](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quiet());
        node->start<atirma::gprs_proxy>("atirma/shore/gprs", listening(7415), gprs_options);
        return node;
    });
    world.host("carrier").start_process("carrier", [this](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quiet());
        node->start<atirma::gprs_link_emulator>("atirma/carrier", listening(7416), carrier_options);
        return node;
    });
    boat_options.gprs = protocol + "://carrier:7421";
    boat_options.boot = 100;
    boat_process().restart();
}

gprs_sea::watched_link& gprs_sea::watch_gprs() {
    auto& into = link_;
    user([&into](ise::component& self) -> ise::task<> {
        self.listen(gprs(self), atirma::services::telecommand_state,
                    [&into](const atirma::telecommand_status& state) { into.states.push_back(state); });
        self.listen(gprs(self), atirma::services::gprs,
                    [&into](const atirma::gprs_state& state) { into.state = state; });
        self.listen(boat_of(self), atirma::services::truth,
                    [&into](const atirma::ground_truth& truth) { into.truth = truth; });
        auto shore = gprs(self);
        auto many = ise::subscribe_options::keep_last(20'000);
        auto packets = co_await shore.subscribe(atirma::services::telemetry, many);
        for (;;) {
            auto packet = co_await packets.next();
            if (!packet) break;
            into.lost += packet.lost_before().value_or(0);
            if (into.known.first_time(packet->boot, packet->sequence, packet->raw)) into.telemetry.push_back(*packet);
            else ++into.again;
        }
    });
    return into;
}

void gprs_sea::carrier_does(const atirma::carrier_request& request) {
    bool done = false;
    user([request, &done](ise::component& self) -> ise::task<> {
        auto it = carrier(self);
        auto response = co_await it.try_call(atirma::services::carrier_control, request, 5s);
        response.value();
        done = true;
    });
    REQUIRE(until([&] { return done; }));
}

void gprs_sea::radio(bool up) {
    bool done = false;
    user([up, &done](ise::component& self) -> ise::task<> {
        atirma::xbee_air_request request;
        request.up = up;
        auto it = air(self);
        auto response = co_await it.try_call(atirma::services::air_control, request, 5s);
        response.value();
        done = true;
    });
    REQUIRE(until([&] { return done; }));
}

void gprs_sea::command(atirma::telecommand_request request, ise::duration deadline, asked& into, bool by_gprs) {
    user([request, deadline, &into, by_gprs](ise::component& self) -> ise::task<> {
        auto shore = by_gprs ? gprs(self) : proxy(self);
        into = co_await shore.try_call(atirma::services::telecommand, request, deadline);
    });
}

atirma::web_server& gprs_sea::start_page_of_both() {
    atirma::web_server* made = nullptr;
    world.host("page").start_process("page", [&made](ise::sim::process& here) -> std::shared_ptr<void> {
        atirma::web_server_options options;
        options.telemetry = {"tcp://shore:7411", "tcp://shore:7415"};
        auto node = std::make_shared<ise::node>(here, quiet());
        made = &node->start<atirma::web_server>("atirma/page", listening(7414), std::move(options));
        return node;
    });
    return *made;
}

bool gprs_sea::whole() const {
    const auto& result = link_.truth;
    // Each has a number of its own on this link: as many as were acknowledged must be here.
    return result && result->gprs_waiting == 0 && result->gprs_dropped == 0 &&
           link_.telemetry.size() >= result->gprs_acknowledged;
}
