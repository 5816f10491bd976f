// At the real boundary: posts by sockets of the test's own, DirectIP over TCP, a modem on a pseudo-terminal, a file on
// disk.
#include <components/boat_simulator/boat_simulator.hpp>
#include <components/iridium/bundle.hpp>
#include <components/iridium/directip.hpp>
#include <components/iridium/rockblock.hpp>
#include <components/iridium_gateway/iridium_gateway.hpp>
#include <components/iridium_modem/iridium_modem.hpp>
#include <components/iridium_proxy/iridium_proxy.hpp>

#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>

#include <support/catch.hpp>

#include <asio/buffer.hpp>
#include <asio/connect.hpp>
#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/read.hpp>
#include <asio/write.hpp>
#include <fmt/format.h>

#include <condition_variable>
#include <filesystem>
#include <mutex>

#include <unistd.h>

using namespace std::chrono_literals;
using namespace atirma;

namespace {

constexpr auto boat_imei = "300234010753370";

struct folder {
    std::filesystem::path path = std::filesystem::temp_directory_path() / fmt::format("ise-iridium-{}", ::getpid());
    folder() { std::filesystem::create_directories(path); }
    ~folder() { std::filesystem::remove_all(path); }
    std::string file(const std::string& name) const { return (path / name).string(); }
};

ise::node_options quiet() {
    ise::node_options options;
    options.use_names = false;
    options.log = std::getenv("ISE_TEST_LOG") ? ise::log_to_stderr(ise::log_level::debug) : ise::log_sink();
    return options;
}

ise::component_options listening(const std::string& name) {
    ise::component_options options;
    options.listen = {ise::endpoint::parse(fmt::format("local://@ise-iridium-{}-{}", ::getpid(), name)).value()};
    return options;
}

std::string where(const std::string& name) { return fmt::format("local://@ise-iridium-{}-{}", ::getpid(), name); }

/// What a component tells once it listens; asked on its own loop.
template <class C, class Ask>
ise::endpoint where_it_listens(C& component, Ask ask) {
    auto body = [](C& of, Ask question) -> ise::task<ise::endpoint> {
        for (;;) {
            auto result = question(of);
            if (result) co_return *result;
            co_await of.sleep(5ms);
        }
    };
    return component.wait(body(component, ask));
}

/// Sends bytes and reads until the other side closes, with a socket of its own.
std::string exchange(const ise::endpoint& with, std::string_view text, bool finish) {
    asio::io_context context;
    asio::ip::tcp::socket socket(context);
    socket.connect({asio::ip::make_address(with.host), with.port});
    asio::write(socket, asio::buffer(text));
    std::error_code ended;
    // Nonsense may have been cut off before it.
    if (finish) socket.shutdown(asio::ip::tcp::socket::shutdown_send, ended);
    std::string answer;
    asio::read(socket, asio::dynamic_buffer(answer), ended);
    return answer;
}

std::string post(const ise::endpoint& to, std::string_view body, std::string_view target = "/rockblock/mo",
                 std::string_view method = "POST") {
    auto text = fmt::format(
        "{} {} HTTP/1.1\r\nHost: shore\r\nContent-Type: application/x-www-form-urlencoded\r\nContent-Length: {}\r\n"
        "Connection: close\r\n\r\n{}",
        method, target, body.size(), body);
    return exchange(to, text, false);
}

int status_of(const std::string& answer) { return answer.size() > 12 ? std::atoi(answer.c_str() + 9) : 0; }

iridium::mo_delivery delivery(std::uint32_t sequence) {
    iridium::mo_delivery made;
    made.message.imei = boat_imei;
    made.message.momsn = static_cast<std::uint16_t>(sequence);
    made.message.session_time = std::chrono::sys_seconds(std::chrono::seconds(1'700'000'000 + sequence));
    packet_header header;
    header.boot = 3;
    header.sequence = sequence;
    made.message.data = encode_telemetry(header, wind());
    return made;
}

/// What a console was told, from the threads of its node.
struct heard {
    std::mutex lock;
    std::condition_variable more;
    std::vector<telemetry_packet> telemetry;
    std::vector<telecommand_status> states;

    template <class Done>
    bool wait(Done done) {
        std::unique_lock guard(lock);
        return more.wait_for(guard, 60s, done);
    }
    template <class T>
    void add(std::vector<T>& to, const T& what) {
        std::lock_guard guard(lock);
        to.push_back(what);
        more.notify_all();
    }
};

void listen_to_proxy(ise::node& node, heard& into) {
    ise::component_options asks_only;
    asks_only.listens = false;
    node.start(
        "",
        [&into](ise::component& self) -> ise::task<> {
            auto shore = self.at(ise::endpoint::parse(where("proxy")).value());
            self.listen(shore, services::telemetry,
                        [&into](const telemetry_packet& packet) { into.add(into.telemetry, packet); });
            self.listen(shore, services::telecommand_state,
                        [&into](const telecommand_status& state) { into.add(into.states, state); });
            co_return;
        },
        asks_only);
}

iridium_proxy_options proxy_options(const folder& there) {
    iridium_proxy_options options;
    options.imei = boat_imei;
    options.database = there.file("iridium.db");
    options.webhook = "tcp://127.0.0.1:0";
    options.directip = "tcp://127.0.0.1:0";
    options.send_by = "none";
    return options;
}

} // namespace

TEST_CASE("iridium: posts by real sockets are answered as their content deserves, and survive the proxy on disk") {
    folder there;
    ise::real_environment world;
    heard console;
    {
        ise::node node(world, quiet());
        auto& proxy = node.start<iridium_proxy>("atirma/shore/iridium", listening("proxy"), proxy_options(there));
        listen_to_proxy(node, console);
        auto at = where_it_listens(proxy, [](iridium_proxy& p) { return p.webhook_at(); });
        auto body = iridium::encode_mo_form(delivery(1));
        CHECK(status_of(post(at, body)) == 200);
        CHECK(status_of(post(at, body)) == 200); // the gateway repeats itself
        CHECK(status_of(post(at, iridium::encode_mo_json(delivery(2)))) == 200);
        auto stranger = delivery(3);
        stranger.message.imei = "300234010753371";
        CHECK(status_of(post(at, iridium::encode_mo_form(stranger))) == 403);
        CHECK(status_of(post(at, "imei=1")) == 400);
        CHECK(post(at, body.substr(0, body.size() - 1)).find("hex digits are no whole bytes") != std::string::npos);
        CHECK(status_of(post(at, body, "/elsewhere")) == 404);
        CHECK(status_of(post(at, "", "/rockblock/mo", "GET")) == 405);
        CHECK(status_of(post(at, std::string(70'000, 'x'))) == 413);
        CHECK(status_of(exchange(at, "hello\r\n\r\n", false)) == 400);
        auto forged = iridium::encode_mo_form(delivery(3)); // by a page that a user of this machine opens
        CHECK(status_of(exchange(at,
                                 fmt::format("POST /rockblock/mo HTTP/1.1\r\nHost: {}:{}\r\nOrigin: "
                                             "https://evil.example\r\nContent-Length: {}\r\nConnection: "
                                             "close\r\n\r\n{}",
                                             at.host, at.port, forged.size(), forged),
                                 false)) == 403);
        REQUIRE(console.wait([&] { return console.telemetry.size() == 2; }));
        node.stop();
        node.wait();
        for (const auto& report : node.reports()) CHECK(report.failure.empty());
    }
    ise::node node(world, quiet());
    auto& proxy = node.start<iridium_proxy>("atirma/shore/iridium", listening("proxy"), proxy_options(there));
    listen_to_proxy(node, console);
    auto at = where_it_listens(proxy, [](iridium_proxy& p) { return p.webhook_at(); });
    CHECK(status_of(post(at, iridium::encode_mo_form(delivery(1)))) == 200); // still known
    CHECK(status_of(post(at, iridium::encode_mo_form(delivery(4)))) == 200);
    REQUIRE(console.wait([&] { return console.telemetry.size() >= 3; }));
    CHECK(console.telemetry.back().sequence == 4);
    CHECK(console.telemetry.size() == 3);
}

TEST_CASE("iridium: DirectIP over TCP is confirmed once the message is on disk") {
    folder there;
    ise::real_environment world;
    heard console;
    ise::node node(world, quiet());
    auto& proxy = node.start<iridium_proxy>("atirma/shore/iridium", listening("proxy"), proxy_options(there));
    listen_to_proxy(node, console);
    auto at = where_it_listens(proxy, [](iridium_proxy& p) { return p.directip_at(); });
    auto send = [&](const iridium::mo_message& message) {
        auto raw = iridium::encode_directip_mo(message);
        return exchange(at, ise::as_text(raw), true);
    };
    auto good = iridium::encode_mo_confirmation(true), bad = iridium::encode_mo_confirmation(false);
    CHECK(send(delivery(1).message) == ise::as_text(good));
    CHECK(send(delivery(1).message) == ise::as_text(good));
    auto stranger = delivery(2).message;
    stranger.imei = "300234010753371";
    CHECK(send(stranger) == ise::as_text(bad));
    CHECK(exchange(at, "not an sbd file.\n", true).empty());
    CHECK(exchange(at, std::string("\x01\xff\xff", 3), true).empty());
    CHECK(exchange(at,
                   std::string("\x01\x00\x05"
                               "ab",
                               5),
                   true)
              .empty()); // cut off
    REQUIRE(console.wait([&] { return !console.telemetry.empty(); }));
    CHECK(console.telemetry.size() == 1);
}

TEST_CASE("iridium: boat, modem on a pseudo-terminal, gateway, web hook and submission by HTTP, on the real clock") {
    folder there;
    ise::real_environment world;
    heard console;
    ise::node node(world, quiet());
    // The gateway must know where the proxy listens, and the proxy where the gateway does: ports of this test's own
    // choice.
    auto options = proxy_options(there);
    iridium_gateway_options gateway;
    gateway.model.imeis = {boat_imei};
    gateway.listen = "tcp://127.0.0.1:0";
    gateway.delivery_delay_s = 0.05;
    gateway.ring_delay = 50ms;
    options.send_by = "http";
    options.rockblock.username = options.rockblock.password = "atirma";

    // A relay of addresses: the first proxy only finds a free port, which the gateway is then told.
    ise::endpoint hook;
    {
        ise::node finder(world, quiet());
        auto finding = options;
        finding.database = there.file("finder.db");
        finding.send_by = "none";
        auto& proxy = finder.start<iridium_proxy>("finder", listening("finder"), finding);
        hook = where_it_listens(proxy, [](iridium_proxy& p) { return p.webhook_at(); });
    }
    options.webhook = fmt::format("tcp://127.0.0.1:{}", hook.port);
    gateway.post_to = fmt::format("http://127.0.0.1:{}/rockblock/mo", hook.port);
    auto& central = node.start<iridium_gateway>("atirma/iridium/gateway", listening("gateway"), gateway);
    auto at = where_it_listens(central, [](iridium_gateway& g) { return g.submissions_at(); });
    options.rockblock.url = fmt::format("http://127.0.0.1:{}/rockblock/MT", at.port);

    iridium_modem_options modem;
    modem.port = there.file("modem");
    modem.gateway = where("gateway");
    modem.min_session_s = 0.02;
    modem.max_session_s = 0.05;
    node.start<iridium_modem>("atirma/iridium/modem", listening("modem"), modem);
    boat_simulator_options boat;
    boat.port.device.clear();
    boat.iridium.port.device = modem.port;
    boat.iridium.period_s = 1;
    node.start<boat_simulator>("atirma/boat", listening("boat"), boat);
    node.start<iridium_proxy>("atirma/shore/iridium", listening("proxy"), options);
    listen_to_proxy(node, console);
    REQUIRE(console.wait([&] { return console.telemetry.size() >= 2; }));

    ise::component_options asks_only;
    asks_only.listens = false;
    auto& user = node.start(
        "", [](ise::component&) -> ise::task<> { co_return; }, asks_only);
    auto command = [](ise::component& self) -> ise::task<ise::result<telecommand_reply>> {
        telecommand_request request;
        request.id = 17;
        request.command = commands::set_mode{sailing_mode::hold};
        auto shore = self.at(ise::endpoint::parse(where("proxy")).value());
        auto reply = co_await shore.try_call(services::telecommand, request, 60s);
        co_return reply;
    };
    auto reply = user.wait(command(user));
    REQUIRE(reply);
    CHECK(reply->state == telecommand_stage::acknowledged);
    CHECK(reply->text == "hold");
}
