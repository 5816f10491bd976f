// Addresses of the boat that are no longer used, at the emulated carrier.
#include "quay.hpp"

#include <components/gprs_link/gprs_link_emulator.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace idle_addresses_test {

using namespace std::chrono_literals;
using namespace atirma;
using gprs_test::quay;

TEST_CASE("gprs link: an address ends five minutes after its last datagram, one that is used stays, and one that comes "
          "back is carried") {
    ise::sim::world world(1);
    std::optional<carrier_state> result;
    std::vector<std::string> heard; // ashore
    world.host("shore").start_process("shore", [&](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quay::quiet());
        node->start(
            "",
            [&](ise::component& self) -> ise::task<> {
                auto where = ise::endpoint::parse("udp://0.0.0.0:7420").value();
                auto socket = std::move(self.env().open_datagram(self.on(), where).value());
                for (;;) {
                    auto [problem, got] = co_await socket->receive();
                    if (problem) break;
                    heard.emplace_back(ise::as_text(got->content));
                }
            },
            quay::asks_only());
        return node;
    });
    world.host("carrier").start_process("carrier", [](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quay::quiet());
        gprs_link_options between;
        between.listen = {"udp://0.0.0.0:7420"};
        between.proxy_udp = "udp://shore:7420";
        ise::component_options where;
        where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7411").value()};
        node->start<gprs_link_emulator>("atirma/carrier", where, between);
        return node;
    });
    world.host("boat").start_process("boat", [&](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quay::quiet());
        node->start(
            "",
            [&](ise::component& self) -> ise::task<> {
                self.listen(self.at(ise::endpoint::parse("tcp://carrier:7411").value()), services::carrier,
                            [&](const carrier_state& state) { result = state; });
                std::vector<std::unique_ptr<ise::datagram_socket>> calls;
                ise::endpoint any{ise::protocol::udp, "0.0.0.0", 0, {}};
                auto to = ise::endpoint::parse("udp://carrier:7420").value();
                std::string word = "hello", last = "again";
                for (int i = 0; i < 10; ++i) {
                    calls.push_back(std::move(self.env().open_datagram(self.on(), any).value()));
                    calls.back()->try_send(to, ise::as_bytes(word));
                }
                for (int minute = 0; minute < 20; ++minute) {
                    calls.front()->try_send(to, ise::as_bytes(word));
                    co_await self.sleep(1min);
                }
                calls.back()->try_send(to, ise::as_bytes(last));
                co_await self.sleep(1h);
            },
            quay::asks_only());
        return node;
    });
    world.run_for(1min);
    REQUIRE(result);
    CHECK(result->connections == 10);
    world.run_for(6min);
    CHECK(result->connections == 1);
    world.run_for(12min);
    CHECK(result->connections == 1);
    world.run_for(2min);
    CHECK(result->connections == 2);
    CHECK(std::count(heard.begin(), heard.end(), "hello") == 10 + 20);
    CHECK(std::count(heard.begin(), heard.end(), "again") == 1);
    world.run_for(10min);
    CHECK(result->connections == 0);
}

} // namespace idle_addresses_test
