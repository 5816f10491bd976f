#include <components/http/stream_http_client.hpp>
#include <components/http/webhook_server.hpp>

#include <ise/component/node.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>

#include <array>

namespace server_test {

using namespace atirma;
using namespace std::chrono_literals;

namespace {

ise::endpoint place(const std::string& host, std::uint16_t port) {
    return ise::endpoint{ise::protocol::tcp, host, port, {}};
}

/// A server that answers with what it was told, on the virtual world.
class hook final : public ise::component {
public:
    explicit hook(webhook_limits limits) : limits_(limits) {}
    std::vector<std::string> bodies;
    ise::duration thinks{};
    std::unique_ptr<webhook_server> server;

private:
    ise::task<> run() override {
        auto answer = [this](webhook_request request) { return serve(std::move(request)); };
        auto spawner = [this](std::string name, ise::task<> body) { spawn(std::move(name), std::move(body)); };
        server = std::make_unique<webhook_server>(on(), log(), limits_, answer, spawner);
        server->listen(place("0.0.0.0", 8080)).value();
        spawn("http", server->run());
        co_return;
    }
    ise::task<webhook_answer> serve(webhook_request request) {
        if (thinks > 0s) co_await sleep(thinks);
        if (request.message.body == "throw") throw std::runtime_error("as it was told to");
        webhook_answer answer;
        answer.body = request.message.method + " " + request.message.target + " " + request.message.body;
        bodies.push_back(std::move(request.message.body));
        co_return answer;
    }
    webhook_limits limits_;
};

struct harbour {
    explicit harbour(webhook_limits limits = {}) {
        world.host("shore").start_process("hook", [this, limits](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, quiet());
            ise::component_options silent;
            silent.listens = false;
            server = &node->start<hook>("", silent, limits);
            return node;
        });
    }
    static ise::node_options quiet() {
        ise::node_options options;
        options.use_names = false;
        options.log = {};
        return options;
    }
    void user(std::function<ise::task<>(ise::component&)> body) {
        world.host("net").start_process("user", [body](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, quiet());
            ise::component_options silent;
            silent.listens = false;
            node->start("", body, silent);
            return node;
        });
    }
    using outcome = std::optional<ise::result<http_answer>>;
    void ask(std::string body, outcome& into, ise::duration within = 5s, std::string url = "http://shore:8080/mo?x=1") {
        user([=, &into](ise::component& self) -> ise::task<> {
            stream_http_client client(self.on());
            http_exchange what;
            what.method = "POST";
            what.url = url;
            what.body = body;
            into = co_await client.exchange(std::move(what), within);
        });
    }
    /// Sends a text as it is and gathers what comes until the server closes.
    void raw(std::vector<std::string> pieces, ise::duration between, std::string& received, bool& closed) {
        user([=, &received, &closed](ise::component& self) -> ise::task<> {
            auto hook_at = place("shore", 8080);
            auto connected = co_await self.env().connect(self.on(), hook_at);
            auto line = std::move(connected.value());
            for (const auto& piece : pieces) {
                asio::const_buffer all(piece.data(), piece.size());
                line->try_write(std::span(&all, 1));
                co_await self.sleep(between);
            }
            std::array<char, 1024> buffer;
            for (;;) {
                auto got = co_await line->read_some(asio::buffer(buffer));
                received.append(buffer.data(), got.bytes);
                if (got.problem) break;
            }
            closed = true;
        });
    }

    ise::sim::world world{5};
    hook* server = nullptr;
};

} // namespace

TEST_CASE("http: a post is answered, over the virtual network") {
    harbour it;
    harbour::outcome answer;
    it.ask("hello", answer);
    REQUIRE(it.world.run_until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->status == 200);
    CHECK((*answer)->body == "POST /mo?x=1 hello");
    CHECK(it.server->bodies == std::vector<std::string>{"hello"});
}

TEST_CASE("http: a client learns whether anything was sent") {
    harbour it;
    harbour::outcome none, late, lost;
    it.ask("x", none, 5s, "http://shore:9999/");
    it.server->thinks = 10s;
    it.ask("x", late, 3s);
    REQUIRE(it.world.run_until([&] { return none && late; }));
    CHECK(none->error().code() == ise::errc::unreachable);
    CHECK(none->error().executed() == ise::execution::not_executed);
    CHECK(late->error().code() == ise::errc::timed_out);
    CHECK(late->error().executed() == ise::execution::unknown);
    it.ask("throw", lost, 30s); // a handler's failure ends its connection and nothing else
    REQUIRE(it.world.run_until([&] { return lost.has_value(); }));
    CHECK(lost->error().code() == ise::errc::peer_lost);
    it.server->thinks = 0s;
    harbour::outcome again;
    it.ask("x", again);
    REQUIRE(it.world.run_until([&] { return again.has_value(); }));
    CHECK(*again);
}

TEST_CASE("http: several requests go over one connection, also at once") {
    harbour it;
    std::string received;
    bool closed = false;
    std::string one = "POST /a HTTP/1.1\r\nContent-Length: 1\r\n\r\n";
    it.raw({one + "1" + one + "2", one.substr(0, 20), one.substr(20) + "3", "GET /end HTTP/1.0\r\n\r\n"}, 1s, received,
           closed);
    REQUIRE(it.world.run_until([&] { return closed; }));
    CHECK(it.server->bodies == std::vector<std::string>{"1", "2", "3", ""});
    CHECK(received.find("POST /a 3") != std::string::npos);
    CHECK(received.find("Connection: close") != std::string::npos);
}

TEST_CASE("http: strangers who say nothing, never end, talk nonsense or too much are cut off") {
    harbour it;
    std::string silent, endless, nonsense, big, head;
    bool closed[5] = {};
    it.raw({}, 0s, silent, closed[0]);
    it.raw({"POST /a HTTP/1.1\r\n", "X: 1\r\n", "Y: 2\r\n", "Z: 3\r\n"}, 4s, endless, closed[1]);
    it.raw({"\x16\x03\x01 hello"}, 0s, nonsense, closed[2]);
    it.raw({"POST /a HTTP/1.1\r\nContent-Length: 70000\r\n\r\n"}, 0s, big, closed[3]);
    it.raw({"GET / HTTP/1.1\r\nX: " + std::string(20000, 'x') + "\r\n\r\n"}, 0s, head, closed[4]);
    REQUIRE(it.world.run_until([&] { return closed[0] && closed[1] && closed[2] && closed[3] && closed[4]; }, 2min));
    CHECK(silent.empty());
    CHECK(endless.empty());
    CHECK(nonsense.starts_with("HTTP/1.1 400 "));
    CHECK(big.starts_with("HTTP/1.1 413 "));
    CHECK(head.starts_with("HTTP/1.1 431 "));
    CHECK(it.server->bodies.empty());
    CHECK(it.server->server->connections() == 0);
}

TEST_CASE("http: too many connections are told so, and those that are served go on") {
    webhook_limits limits;
    limits.max_connections = 2;
    harbour it(limits);
    it.server->thinks = 5s;
    std::string a, b, c;
    bool a_closed = false, b_closed = false, c_closed = false;
    std::string request = "POST /a HTTP/1.1\r\nConnection: close\r\nContent-Length: 1\r\n\r\n1";
    it.raw({request}, 1s, a, a_closed);
    it.raw({request}, 1s, b, b_closed);
    it.world.run_for(1s);
    it.raw({}, 0s, c, c_closed);
    REQUIRE(it.world.run_until([&] { return a_closed && b_closed && c_closed; }));
    CHECK(c.starts_with("HTTP/1.1 503 "));
    CHECK(a.starts_with("HTTP/1.1 200 "));
    CHECK(b.starts_with("HTTP/1.1 200 "));
}

TEST_CASE("http: a host that holds every connection and says nothing keeps no gateway out") {
    harbour it; // 32
    std::string silent[40];
    bool closed[40] = {};
    for (int i = 0; i < 40; ++i) it.raw({"POST /a HT"}, 1s, silent[i], closed[i]);
    it.world.run_for(3s);
    CHECK(it.server->server->connections() == 32);
    CHECK(closed[0]);
    CHECK_FALSE(closed[39]);
    harbour::outcome answer;
    it.ask("hello", answer, 2s);
    REQUIRE(it.world.run_until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->status == 200);
}

} // namespace server_test
