// The same on real sockets of this machine.
#include "caller.hpp"

#include <components/gprs_link/gprs_link_emulator.hpp>
#include <components/gprs_proxy/gprs_proxy.hpp>

#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>

#include <support/authority.hpp>
#include <support/catch.hpp>

#include <atomic>
#include <future>

namespace real_sockets_test {

using namespace std::chrono_literals;
using namespace atirma;

namespace {

ise::node_options quiet(const std::string& tls = {}) {
    ise::node_options made;
    made.security.tls_folder = tls;
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

/// Five fixes and a telecommand over `where`, with a carrier in between if asked for; `tls`: certificates of all.
void sail(const std::string& where, bool carrier, const std::string& tls = {}) {
    ise::real_environment env;
    gprs_test::boat_log boat; // outlives the node
    std::promise<std::vector<ise::endpoint>> listening, carrying;
    std::promise<std::vector<telemetry_packet>> all;
    std::promise<telecommand_reply> answered;
    ise::node node(env, quiet(tls));
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
        auto secured = called.kind == ise::protocol::tls; // the carrier carries what it cannot read
        if (secured) called.kind = ise::protocol::tcp;
        between.listen = {secured ? "tcp://127.0.0.1:0" : where};
        (called.kind == ise::protocol::tcp ? between.proxy_tcp : between.proxy_udp) = called.text();
        between.delay_s = 0.05;
        between.on_listening = [&](const std::vector<ise::endpoint>& at) { carrying.set_value(at); };
        node.start<gprs_link_emulator>("atirma/carrier", loopback(), between);
        called = carrying.get_future().get().at(0);
        if (secured) called.kind = ise::protocol::tls;
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

ise_test::authority& trusted() {
    static ise_test::authority made("the owner of the boat");
    return made;
}

/// A boat with the certificates of `tls` calls a proxy that listens on tls: the warnings of the proxy and of the boat.
std::pair<std::string, std::string> refusal(const std::string& scheme, const std::string& tls,
                                            gprs_test::boat_log& boat) {
    ise::real_environment env;
    std::promise<std::vector<ise::endpoint>> listening;
    std::promise<std::string> warned, at_sea;
    std::atomic<bool> result = false, told_at_sea = false;
    auto with_log = quiet(trusted().issue("shore").string());
    with_log.log = [&](const ise::log_record& record) {
        auto line = ise::format_line(record);
        if (line.find("a login over tls is refused") != line.npos && !result.exchange(true)) warned.set_value(line);
    };
    auto with_sea_log = quiet(tls);
    with_sea_log.log = [&](const ise::log_record& record) {
        if (record.level == ise::log_level::warning && !told_at_sea.exchange(true))
            at_sea.set_value(ise::format_line(record));
    };
    ise::node shore(env, with_log), sea(env, with_sea_log);
    gprs_proxy_options options;
    options.listen = {"tls://127.0.0.1:0"};
    options.on_listening = [&](const std::vector<ise::endpoint>& at) { listening.set_value(at); };
    auto proxies = loopback();
    proxies.listen = {ise::endpoint::parse("inproc://gprs-proxy").value()};
    shore.start<gprs_proxy>("atirma/shore/gprs", proxies, options);
    auto called = listening.get_future().get().at(0);
    boat.shore = scheme + "://127.0.0.1:" + std::to_string(called.port);
    boat.fixes = 1;
    sea.start<gprs_test::caller>("", asks_only(), boat);
    auto lines = std::pair(warned.get_future().get(), at_sea.get_future().get());
    sea.stop();
    sea.wait();
    shore.stop();
    shore.wait();
    CHECK(boat.acknowledged == 0);
    return lines;
}

} // namespace

TEST_CASE("gprs real: over tls") { sail("tls://127.0.0.1:0", false, trusted().issue("all").string()); }
TEST_CASE("gprs real: over tls through a carrier") {
    sail("tls://127.0.0.1:0", true, trusted().issue("all-by-carrier").string());
}

TEST_CASE("gprs real: a boat with a certificate of another authority does not log in, and both ends say why") {
    ise_test::authority stranger("somebody else");
    gprs_test::boat_log boat;
    auto [line, at_sea] = refusal("tls", stranger.issue("boat").string(), boat);
    INFO(line);
    CHECK(line.find("from=tls://127.0.0.1:") != line.npos);
    CHECK(line.find("authority") != line.npos);
    INFO(at_sea);
    CHECK(at_sea.find("authority") != at_sea.npos);
}

TEST_CASE("gprs real: a boat that calls a tls endpoint without tls does not log in") {
    gprs_test::boat_log boat;
    auto [line, at_sea] = refusal("tcp", {}, boat);
    INFO(line << at_sea);
    CHECK(line.find("cause=") != line.npos);
}

TEST_CASE("gprs real: tls without certificates ends boat and proxy with what to do") {
    ise::real_environment env;
    gprs_test::boat_log boat;
    boat.shore = "tls://127.0.0.1:7420";
    ise::node node(env, quiet());
    gprs_proxy_options options;
    options.listen = {"tls://127.0.0.1:0"};
    node.launch("atirma/shore/gprs", std::make_unique<gprs_proxy>(options), loopback());
    node.launch("boat", std::make_unique<gprs_test::caller>(boat), loopback());
    node.wait();
    auto reports = node.reports();
    REQUIRE(reports.size() == 2);
    for (const auto& report : reports) {
        INFO(report.path << ": " << report.failure);
        CHECK(report.failure.find("certificate") != std::string::npos);
        CHECK(report.failure.find("--tls FOLDER or ISE_TLS") != std::string::npos);
    }
}

TEST_CASE("gprs real: over tcp") { sail("tcp://127.0.0.1:0", false); }
TEST_CASE("gprs real: over udp") { sail("udp://127.0.0.1:0", false); }
TEST_CASE("gprs real: over tcp and IPv6") { sail("tcp://[::1]:0", false); }
TEST_CASE("gprs real: over udp and IPv6") { sail("udp://[::1]:0", false); }
TEST_CASE("gprs real: over tcp through a carrier") { sail("tcp://127.0.0.1:0", true); }
TEST_CASE("gprs real: over udp through a carrier") { sail("udp://127.0.0.1:0", true); }

} // namespace real_sockets_test
