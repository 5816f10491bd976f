#include <components/nmea_bridge/nmea_bridge.hpp>

#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/sim/world.hpp>

#include <asio/buffer.hpp>

#include <support/catch.hpp>
#include <support/program.hpp>

#include <nlohmann/json.hpp>

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace bridge_test {

using namespace atirma;
using namespace std::chrono_literals;

namespace {

/// A proxy that publishes what a test gives it.
class proxy final : public ise::component {
public:
    /// `sails`: tells a position of this quality every 100 ms. Refuses the first `refusals` subscribers as a provider
    /// that stops does.
    explicit proxy(fix_quality sails = fix_quality::none, int refusals = 0) : sails_(sails), refusals_(refusals) {}

    void tell(const telemetry_body& body, utc_time at) {
        telemetry_packet made;
        made.boot = 1;
        made.sequence = ++sequence_;
        made.measured_at = at;
        made.received_at = std::chrono::floor<std::chrono::milliseconds>(wall());
        packet_header header;
        header.boot = made.boot;
        header.sequence = made.sequence;
        header.measured_at = at;
        made.raw = encode_telemetry(header, body);
        out_(made);
    }
    utc_time clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }
    std::size_t listeners() const { return out_.subscribers(); }

private:
    ise::task<> run() override {
        ise::publication_callbacks<ise::subscription<telemetry_packet>> callbacks;
        callbacks.on_subscribe = [this](const auto&, const auto&) -> ise::result<ise::nothing> {
            if (refusals_-- > 0) return ise::failure(ise::errc::cancelled, "the proxy stops");
            return ise::nothing();
        };
        out_ = publish(services::telemetry, std::move(callbacks));
        for (;;) {
            co_await sleep(100ms);
            if (sails_ == fix_quality::none) continue;
            location at;
            at.latitude_deg = 28.153;
            at.longitude_deg = -15.448;
            at.quality = sails_;
            at.satellites = 9;
            at.speed_over_ground_mps = 1.5f;
            tell(at, clock());
        }
    }
    ise::publication<ise::subscription<telemetry_packet>> out_;
    std::uint32_t sequence_ = 0;
    fix_quality sails_;
    int refusals_;
};

location somewhere() {
    location made;
    made.latitude_deg = 28.153;
    made.longitude_deg = -15.448;
    made.quality = fix_quality::gps;
    return made;
}

ise::node_options quiet() {
    ise::node_options made;
    made.use_names = false;
    made.log = ise::log_sink();
    return made;
}
ise::component_options at_port(std::uint16_t port, const char* host = "0.0.0.0") {
    ise::component_options made;
    made.listen = {ise::endpoint{ise::protocol::tcp, host, port, {}}};
    return made;
}

std::size_t count(const std::string& in, const std::string& what) {
    std::size_t found = 0;
    for (auto at = in.find(what); at != std::string::npos; at = in.find(what, at + 1)) ++found;
    return found;
}

/// The bridge on one host of the virtual world, the proxy on another, and whoever listens on a third.
struct sea {
    ise::sim::world world{3};
    proxy* boat = nullptr;
    nmea_bridge_options options;
    fix_quality sails = fix_quality::none;
    int refusals = 0;

    sea() {
        options.telemetry = {"tcp://shore:7411"};
        options.nmea.tcp = ise::endpoint{ise::protocol::tcp, "0.0.0.0", 10110, {}};
        options.nmea.udp = {ise::endpoint{ise::protocol::udp, "listener", 10111, {}}};
        options.signalk.tcp = ise::endpoint{ise::protocol::tcp, "0.0.0.0", 8375, {}};
    }
    void start() {
        world.host("shore").start_process("proxy", [this](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, quiet());
            boat = &node->start<proxy>("shore", at_port(7411), sails, refusals);
            return node;
        });
        world.host("bridge").start_process("bridge", [this](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, quiet());
            node->start<nmea_bridge>("bridge", at_port(7412), options);
            return node;
        });
        REQUIRE(world.run_until(
            [&] { return boat && boat->state() == ise::component_state::ready && boat->listeners() == 1; }, 1min));
    }
    void listener(std::function<ise::task<>(ise::component&)> body) {
        world.host("listener").start_process("listener", [body](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, quiet());
            ise::component_options asks_only;
            asks_only.listens = false;
            node->start("", body, asks_only);
            return node;
        });
    }
    /// Connects and keeps all that is said; `reads` false: takes nothing.
    void connect(std::uint16_t port, std::string& into, bool reads = true) {
        listener([port, &into, reads](ise::component& self) -> ise::task<> {
            ise::endpoint where{ise::protocol::tcp, "bridge", port, {}};
            auto stream = co_await self.env().connect(self.on(), where);
            auto& line = *stream.value();
            for (char piece[512]; reads;) {
                auto got = co_await line.read_some(asio::buffer(piece));
                if (got.problem) break;
                into.append(piece, got.bytes);
            }
            if (!reads) co_await self.sleep(24h);
        });
    }
};

} // namespace

TEST_CASE("each report is told once, and a position that has grown old as none") {
    sea s;
    s.start();
    std::string nmea, signalk, datagrams;
    s.connect(10110, nmea);
    s.connect(8375, signalk);
    s.listener([&](ise::component& self) -> ise::task<> {
        ise::endpoint here{ise::protocol::udp, "0.0.0.0", 10111, {}};
        auto socket = self.env().open_datagram(self.on(), here);
        for (;;) {
            auto [problem, one] = co_await (*socket)->receive();
            if (problem) break;
            datagrams += ise::as_text(one->content);
        }
    });
    s.world.run_for(3s);
    CHECK(count(nmea, "$GPRMC") == 1); // the greeting: none yet
    CHECK(nmea.find(",V,") != std::string::npos);
    nmea.clear();
    s.boat->tell(somewhere(), s.boat->clock());
    REQUIRE(s.world.run_until(
        [&] { return count(nmea, ",A,2809.1800,N") == 1 && count(datagrams, ",A,2809.1800,N") == 1; }, 10s));
    s.world.run_for(50s);
    CHECK(count(nmea, "$GPRMC") == 1); // not repeated
    CHECK(count(nmea, ",V,") == 0);
    s.world.run_for(20s);
    CHECK(count(nmea, ",V,") > 0);
    CHECK(count(datagrams, ",V,") > 0);
    CHECK(count(nmea, ",A,") == 1);
    CHECK(count(signalk, "28.153") == 1);
    CHECK(count(signalk, "\"value\":null") == 2); // the greeting, and once it is old
    // A new one ends that, and who comes now is told at once.
    s.boat->tell(somewhere(), s.boat->clock());
    REQUIRE(s.world.run_until([&] { return count(nmea, ",A,2809.1800,N") == 2; }, 10s));
    std::string late;
    s.connect(10110, late);
    REQUIRE(s.world.run_until([&] { return count(late, ",A,2809.1800,N") == 1; }, 10s));
}

TEST_CASE("a proxy that stops while the bridge subscribes is subscribed to again") {
    sea s;
    s.refusals = 1;
    s.start(); // until the bridge is subscribed
    std::string nmea;
    s.connect(10110, nmea);
    s.world.run_for(1s);
    s.boat->tell(somewhere(), s.boat->clock());
    CHECK(s.world.run_until([&] { return count(nmea, ",A,2809.1800,N") == 1; }, 10s));
}

TEST_CASE("what was measured long ago is no news when it arrives") {
    sea s;
    s.start();
    std::string nmea;
    s.connect(10110, nmea);
    s.world.run_for(1s);
    s.boat->tell(somewhere(), s.boat->clock() - 10min);
    s.boat->tell(wind{}, s.boat->clock() - 10min);
    s.world.run_for(10s);
    CHECK(count(nmea, ",A,2809") == 0);
    CHECK(count(nmea, "MWV") == 0);
}

TEST_CASE("a client that takes nothing is dropped and counted, and the others hear everything") {
    sea s;
    s.options.nmea.max_queued_bytes = 2000;
    s.sails = fix_quality::gps;
    s.start();
    std::string good, nothing;
    std::optional<bridge_status> result;
    s.connect(10110, good);
    s.connect(10110, nothing, false);
    s.listener([&](ise::component& self) -> ise::task<> {
        auto bridge = self.at(ise::endpoint{ise::protocol::tcp, "bridge", 7412, {}});
        auto states = co_await bridge.subscribe(services::bridge);
        for (;;) {
            auto one = co_await states.next();
            if (!one) break;
            result = *one;
        }
    });
    REQUIRE(s.world.run_until([&] { return result && result->nmea.dropped_slow == 1; }, 2h));
    auto before = count(good, "$GPRMC");
    s.world.run_for(10s);
    CHECK(count(good, "$GPRMC") >= before + 90);
    REQUIRE(s.world.run_until([&] { return result->nmea.clients == 1; }, 1min));
    CHECK(result->nmea.accepted == 2);
}

TEST_CASE("clients beyond the most are refused and counted") {
    sea s;
    s.options.nmea.max_clients = 1;
    s.start();
    std::string first, second;
    s.connect(10110, first);
    s.world.run_for(1s);
    s.connect(10110, second);
    s.world.run_for(1s);
    CHECK_FALSE(first.empty());
    CHECK(second.empty());
}

namespace {

std::uint16_t free_port(int kind) {
    int one = ::socket(AF_INET, kind | SOCK_CLOEXEC, 0);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof at;
    bool bound = ::bind(one, reinterpret_cast<sockaddr*>(&at), size) == 0 &&
                 ::getsockname(one, reinterpret_cast<sockaddr*>(&at), &size) == 0;
    ::close(one);
    REQUIRE(bound);
    return ntohs(at.sin_port);
}

} // namespace

TEST_CASE("gpsd sees the boat") {
    for (const char* file : {"/usr/sbin/gpsd", "/usr/bin/gpspipe"}) {
        if (::access(file, X_OK) != 0) {
            WARN("skipped: " << file << " is not installed");
            return;
        }
    }
    auto way = GENERATE(as<std::string>(), "udp", "tcp");
    auto quality = GENERATE(fix_quality::gps, fix_quality::simulated);
    CAPTURE(way, name_of(quality));
    auto port = free_port(way == "udp" ? SOCK_DGRAM : SOCK_STREAM), served = free_port(SOCK_STREAM);
    nmea_bridge_options options;
    options.telemetry = {"local://@ise-nmea-" + std::to_string(::getpid())};
    if (way == "udp") options.nmea.udp = {ise::endpoint{ise::protocol::udp, "127.0.0.1", port, {}}};
    else options.nmea.tcp = ise::endpoint{ise::protocol::tcp, "127.0.0.1", port, {}};

    ise::real_environment env;
    ise::node node(env, quiet());
    ise::component_options here;
    here.listen = {ise::endpoint::parse(options.telemetry[0]).value()};
    node.start<proxy>("shore", here, quality);
    node.start<nmea_bridge>("bridge", at_port(0, "127.0.0.1"), options);

    auto source = way + "://127.0.0.1:" + std::to_string(port);
    ise_test::program gpsd({"/usr/sbin/gpsd", "-N", "-n", "-S", std::to_string(served), source});
    std::string found;
    for (int attempt = 0; attempt < 200 && found.empty(); ++attempt) { // gpsd takes a moment to serve
        ise_test::program pipe({"/usr/bin/gpspipe", "-w", "127.0.0.1:" + std::to_string(served)});
        for (auto line = pipe.read_line(); !line.empty() && found.empty(); line = pipe.read_line())
            if (line.find("\"TPV\"") != std::string::npos && line.find("\"lat\"") != std::string::npos) found = line;
        if (found.empty()) ::usleep(50'000);
    }
    auto fix = nlohmann::json::parse(found);
    CHECK(fix["mode"].get<int>() >= 2);
    CHECK(fix["lat"].get<double>() == Approx(28.153).margin(1e-5));
    CHECK(fix["lon"].get<double>() == Approx(-15.448).margin(1e-5));
    CHECK(fix["speed"].get<double>() == Approx(1.5).margin(0.01));
}

} // namespace bridge_test
