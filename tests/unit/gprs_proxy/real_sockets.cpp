// The same on real sockets of this machine.
#include "caller.hpp"

#include <components/gprs_link/gprs_link_emulator.hpp>
#include <components/gprs_proxy/gprs_proxy.hpp>

#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>

#include <support/catch.hpp>

#include <future>

namespace real_sockets_test {

using namespace std::chrono_literals;
using namespace atirma;

namespace {

ise::node_options quiet() {
    ise::node_options made;
    made.use_names = false;
    made.log = {};
    return made;
}

ise::component_options loopback() {
    ise::component_options made;
    made.listen = {ise::endpoint::parse("tcp://127.0.0.1:0").value()};
    return made;
}

ise::component_options asks_only() {
    ise::component_options made;
    made.listens = false;
    return made;
}

/// Five fixes and a telecommand over `where`, with a carrier in between if asked for.
void sail(const std::string& where, bool carrier) {
    ise::real_environment env;
    gprs_test::boat_log boat; // outlives the node
    std::promise<std::vector<ise::endpoint>> listening, carrying;
    std::promise<std::vector<telemetry_packet>> all;
    std::promise<telecommand_reply> answered;
    ise::node node(env, quiet());
    gprs_proxy_options options;
    options.listen = {where};
    options.on_listening = [&](const std::vector<ise::endpoint>& at) { listening.set_value(at); };
    auto proxies = loopback();
    proxies.listen = {ise::endpoint::parse("inproc://gprs-proxy").value()};
    node.start<gprs_proxy>("atirma/shore/gprs", proxies, options);
    auto called = listening.get_future().get().at(0);
    CHECK(called.port != 0);
    node.start(
        "",
        [&](ise::component& self) -> ise::task<> {
            auto shore = self.at(ise::endpoint::parse("inproc://gprs-proxy").value());
            auto packets = co_await shore.subscribe(services::telemetry);
            telecommand_request request; // a ping: it waits for the boat
            request.id = 7;
            auto reply = co_await shore.call(services::telecommand, request, 5min);
            answered.set_value(reply);
            std::vector<telemetry_packet> got;
            while (got.size() < 5) {
                auto packet = co_await packets.next();
                if (!packet) break;
                got.push_back(*packet);
            }
            all.set_value(got);
        },
        asks_only());
    if (carrier) {
        gprs_link_options between;
        between.listen = {where};
        (called.kind == ise::protocol::tcp ? between.proxy_tcp : between.proxy_udp) = called.text();
        between.delay_s = 0.05;
        between.on_listening = [&](const std::vector<ise::endpoint>& at) { carrying.set_value(at); };
        node.start<gprs_link_emulator>("atirma/carrier", loopback(), between);
        called = carrying.get_future().get().at(0);
    }
    boat.shore = called.text();
    boat.fixes = 5;
    boat.period = 50ms;
    node.start<gprs_test::caller>("", asks_only(), boat);
    auto got = all.get_future().get();
    REQUIRE(got.size() == 5);
    for (const auto& packet : got) CHECK(packet.link == link_id::gprs);
    CHECK(answered.get_future().get().state == telecommand_stage::acknowledged);
    node.stop();
    node.wait();
    for (const auto& report : node.reports()) CHECK(report.failure.empty());
    CHECK(boat.executed == std::vector<std::uint32_t>{7});
}

} // namespace

TEST_CASE("gprs real: over tcp") { sail("tcp://127.0.0.1:0", false); }
TEST_CASE("gprs real: over udp") { sail("udp://127.0.0.1:0", false); }
TEST_CASE("gprs real: over tcp and IPv6") { sail("tcp://[::1]:0", false); }
TEST_CASE("gprs real: over udp and IPv6") { sail("udp://[::1]:0", false); }
TEST_CASE("gprs real: over tcp through a carrier") { sail("tcp://127.0.0.1:0", true); }
TEST_CASE("gprs real: over udp through a carrier") { sail("udp://127.0.0.1:0", true); }

} // namespace real_sockets_test
