#include <ise/http/http_server.hpp>
#include <ise/http/stream_http_client.hpp>

#include <ise/component/node.hpp>
#include <ise/sim/world.hpp>
#include <unit/http/client.hpp>

#include <asio/buffer.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <array>
#include <functional>
#include <list>

namespace server_test {

using namespace ise;
using namespace std::chrono_literals;

namespace {

ise::endpoint place(const std::string& host, std::uint16_t port) {
    return ise::endpoint{ise::protocol::tcp, host, port, {}};
}

/// A server that answers with what it was told, on the virtual world.
class hook final : public ise::component {
public:
    explicit hook(ise::http_limits limits) : limits_(limits) {}
    std::vector<std::string> bodies;
    ise::duration thinks{};
    std::unique_ptr<ise::http_server> server;
    ise::sse_channel* events = nullptr;
    int snapshots = 0;
    std::size_t pieces = 3, written = 0; ///< of /long, of 64 KiB each
    bool answered = false;               ///< all of it, or until the client left

private:
    ise::task<> run() override {
        auto spawner = [this](std::string name, ise::task<> body) { spawn(std::move(name), std::move(body)); };
        server = std::make_unique<ise::http_server>(on(), log(), limits_, spawner);
        server->otherwise([this](ise::http_request request) { return serve(std::move(request)); });
        server->get("/long", [this](const ise::http_request&) {
            ise::http_response made;
            made.stream = [this](std::shared_ptr<ise::http_stream> to) { return tell(std::move(to)); };
            return made;
        });
        events = &server->events("/events", [this](std::string_view last) {
            return ise::sse_event{"e:" + std::to_string(++snapshots), "snapshot", "after " + std::string(last)};
        });
        server->listen(place("0.0.0.0", 8080)).value();
        co_return;
    }
    ise::task<ise::http_response> serve(ise::http_request request) {
        if (thinks > 0s) co_await sleep(thinks);
        if (request.message.body == "throw") throw std::runtime_error("as it was told to");
        ise::http_response answer;
        answer.body = request.message.method + " " + request.message.target + " " + request.message.body;
        bodies.push_back(std::move(request.message.body));
        co_return answer;
    }
    ise::task<> tell(std::shared_ptr<ise::http_stream> to) {
        const std::string piece(64 * 1024, 'x');
        std::error_code unsent;
        while (!unsent && written < pieces) {
            unsent = co_await to->write(piece);
            if (!unsent) ++written;
        }
        answered = true;
    }
    ise::http_limits limits_;
};

struct harbour {
    explicit harbour(ise::http_limits limits = {}) {
        world.host("shore").start_process("hook", [this, limits](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, quiet());
            ise::component_options silent;
            silent.listens = false;
            server = &node->start<hook>("", silent, limits);
            return node;
        });
        REQUIRE(world.run_until([this] { return server && server->server; }));
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
    using outcome = std::optional<ise::result<ise::http_answer>>;
    void ask(std::string body, outcome& into, ise::duration within = 5s, std::string url = "http://shore:8080/mo?x=1") {
        user([=, &into](ise::component& self) -> ise::task<> {
            ise::stream_http_client client(self.on());
            ise::http_exchange what;
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
    harbour::outcome none, late, failed;
    it.ask("x", none, 5s, "http://shore:9999/");
    it.server->thinks = 10s;
    it.ask("x", late, 3s);
    REQUIRE(it.world.run_until([&] { return none && late; }));
    CHECK(none->error().code() == ise::errc::unreachable);
    CHECK(none->error().executed() == ise::execution::not_executed);
    CHECK(late->error().code() == ise::errc::timed_out);
    CHECK(late->error().executed() == ise::execution::unknown);
    it.ask("throw", failed, 30s);
    REQUIRE(it.world.run_until([&] { return failed.has_value(); }));
    CHECK((*failed)->status == 500);
    CHECK((*failed)->body.find("as it was told to") == std::string::npos);
    CHECK(it.server->server->statistics().handlers_failed == 1);
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
    std::string silent, endless, nonsense, big, head, url;
    bool closed[6] = {};
    it.raw({}, 0s, silent, closed[0]);
    it.raw({"POST /a HTTP/1.1\r\n", "X: 1\r\n", "Y: 2\r\n", "Z: 3\r\n"}, 6s, endless, closed[1]);
    it.raw({"\x16\x03\x01 hello"}, 0s, nonsense, closed[2]);
    it.raw({"POST /a HTTP/1.1\r\nContent-Length: 70000\r\n\r\n"}, 0s, big, closed[3]);
    it.raw({"GET / HTTP/1.1\r\nX: " + std::string(20000, 'x') + "\r\n\r\n"}, 0s, head, closed[4]);
    it.raw({"GET /" + std::string(3000, 'x') + " HTTP/1.1\r\n\r\n"}, 0s, url, closed[5]);
    REQUIRE(it.world.run_until([&] { return std::ranges::all_of(closed, std::identity()); }, 2min));
    CHECK(silent.empty());
    CHECK(endless.starts_with("HTTP/1.1 408 "));
    CHECK(url.starts_with("HTTP/1.1 414 "));
    CHECK(nonsense.starts_with("HTTP/1.1 400 "));
    CHECK(big.starts_with("HTTP/1.1 413 "));
    CHECK(head.starts_with("HTTP/1.1 431 "));
    CHECK(it.server->bodies.empty());
    CHECK(it.server->server->statistics().open_connections == 0);
}

TEST_CASE("http: too many connections are told so, and those that are served go on") {
    ise::http_limits limits;
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
    CHECK(it.server->server->statistics().open_connections == 32);
    CHECK(closed[0]);
    CHECK_FALSE(closed[39]);
    harbour::outcome answer;
    it.ask("hello", answer, 2s);
    REQUIRE(it.world.run_until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->status == 200);
}

TEST_CASE("http: requests sent at once are answered one after the other, however long one takes") {
    harbour it;
    it.server->thinks = 3s;
    std::string received;
    bool closed = false;
    it.raw({"GET /1 HTTP/1.1\r\n\r\nHEAD /2 HTTP/1.1\r\n\r\nGET /3 HTTP/1.1\r\nConnection: close\r\n\r\n"}, 0s,
           received, closed);
    it.world.run_for(4s);
    CHECK(received.find("GET /1") != std::string::npos);
    CHECK(it.server->bodies.size() == 1);
    REQUIRE(it.world.run_until([&] { return closed; }));
    CHECK(it.server->bodies.size() == 3);
    CHECK(received.find("GET /1") < received.find("GET /3"));
    CHECK(received.find("HEAD /2") == std::string::npos); // its length only
}

TEST_CASE("http: one connection has so many requests, and is closed then") {
    ise::http_limits limits;
    limits.max_requests = 2;
    harbour it(limits);
    std::string received;
    bool closed = false;
    it.raw({"GET /1 HTTP/1.1\r\n\r\n", "GET /2 HTTP/1.1\r\n\r\n"}, 1s, received, closed);
    REQUIRE(it.world.run_until([&] { return closed; }, 10s));
    CHECK(received.find("Connection: keep-alive") < received.find("Connection: close"));
}

TEST_CASE("http: a body that is made while it is sent comes whole, in chunks or as HTTP/1.0 wants it") {
    harbour it;
    std::string first = "GET /long HTTP/1.1\r\n\r\n", ended = "\r\n0\r\n\r\n";
    std::size_t ends = 7; // "10000\r\n" before each piece, a line break behind it, and the last chunk
    SECTION("HTTP/1.1") {}
    SECTION("HTTP/1.0") {
        first = "GET /long HTTP/1.0\r\n\r\n";
        ended = "x";
        ends = 0;
    }
    std::string received;
    bool closed = false;
    it.raw({first}, 0s, received, closed);
    REQUIRE(it.world.run_until([&] { return closed; }));
    auto body = received.substr(received.find("\r\n\r\n") + 4);
    CHECK(received.starts_with("HTTP/1.1 200 OK"));
    CHECK(received.find("Content-Length") == std::string::npos);
    CHECK(body.ends_with(ended));
    CHECK(body.size() == 3 * (64 * 1024 + (ends ? ends + 2 : 0)) + (ends ? 5 : 0));
    CHECK(it.server->answered);
}

TEST_CASE("http: who reads no further holds a bounded part of a long body, and loses the connection") {
    harbour it;
    it.server->pieces = 1000;
    std::unique_ptr<ise::stream> line;
    it.user([&](ise::component& self) -> ise::task<> {
        auto at = place("shore", 8080);
        auto connected = co_await self.env().connect(self.on(), at);
        line = std::move(connected.value());
        std::string_view text = "GET /long HTTP/1.1\r\n\r\n";
        asio::const_buffer all(text.data(), text.size());
        line->try_write(std::span(&all, 1));
        co_await self.sleep(24h);
    });
    SECTION("after the time for a piece") {
        it.world.run_for(1min);
        CHECK(it.server->written < 100);
        CHECK_FALSE(it.server->answered);
        REQUIRE(it.world.run_until([&] { return it.server->answered; }, 1min));
    }
    SECTION("at once where it leaves") {
        it.world.run_for(5s);
        line->close();
        REQUIRE(it.world.run_until([&] { return it.server->answered; }, 2s));
    }
    CHECK(it.server->written < 100);
    it.world.run_for(2s);
    CHECK(it.server->server->statistics().open_connections == 0);
}

TEST_CASE("http: a host that asks for much and reads nothing holds a bounded part of the memory") {
    web_test::grounds here;
    ise::http_limits limits;
    limits.max_unsent_bytes = 40 << 20;
    ise::http_server server(here.host->loop(), here.log, limits, here.spawner());
    constexpr std::size_t size = 16 << 20; // more than the system's buffers hold
    auto large = [](const ise::http_request&) {
        ise::http_response made;
        made.body = std::string(size, 'x');
        return made;
    };
    server.get("/large", large);
    ise::http_response shared;
    shared.body = std::string(size, 'y');
    server.get("/shared", [shared](const ise::http_request&) { return shared; });
    server.get("/small", [](const ise::http_request&) { return ise::http_response{"small"}; });
    server.listen(web_test::any_port("0.0.0.0")).value();
    const auto port = server.where().port;
    std::list<web_test::client> silent;
    auto ask = [&](std::string_view path) -> web_test::client& {
        auto& one = silent.emplace_back(here.context, port);
        one.get(path);
        one.read_until("\r\n");
        return one;
    };
    CHECK(ask("/shared").received.starts_with("HTTP/1.1 200 "));
    CHECK(ask("/shared").received.starts_with("HTTP/1.1 200 ")); // one body in memory
    CHECK(ask("/large").received.starts_with("HTTP/1.1 200 "));
    CHECK(ask("/large").received.starts_with("HTTP/1.1 503 "));
    CHECK(ask("/shared").received.starts_with("HTTP/1.1 200 "));
    CHECK(here.logged.find("max_unsent_bytes") != std::string::npos);
    if (auto other = web_test::another_host(); !other.empty()) {
        web_test::client friendly(here.context, port, other);
        friendly.get("/large");
        CHECK(friendly.read_answer().size() > size);
    }
    silent.clear();
    CHECK(ask("/large").received.starts_with("HTTP/1.1 200 "));
}

TEST_CASE("http: an event stream over the virtual network: a snapshot, events, comments, and its end") {
    harbour it;
    std::string received;
    bool closed = false;
    it.raw({"GET /events HTTP/1.1\r\nLast-Event-ID: e:7\r\n\r\n"}, 0s, received, closed);
    REQUIRE(it.world.run_until([&] { return received.find("data: after e:7") != std::string::npos; }));
    CHECK(received.find("Content-Type: text/event-stream") != std::string::npos);
    it.server->events->publish({"e:9", "update", "moved"});
    REQUIRE(it.world.run_until(
        [&] { return received.find("id: e:9\nevent: update\ndata: moved\n\n") != std::string::npos; }));
    it.world.run_for(30s);
    it.server->events->tick();
    it.server->events->tick();
    it.world.run_for(40s);
    CHECK(received.find(": still here") != std::string::npos);
    CHECK_FALSE(closed);
    REQUIRE(it.world.run_until([&] { return closed; }, 1min)); // nobody has written for a minute
    CHECK(it.server->events->clients() == 0);
}

TEST_CASE("http: HEAD of an event stream opens none, and other methods are refused there") {
    harbour it;
    std::string received;
    bool closed = false;
    it.raw({"HEAD /events HTTP/1.1\r\n\r\n", "POST /events HTTP/1.1\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"},
           1s, received, closed);
    REQUIRE(it.world.run_until([&] { return closed; }));
    CHECK(received.starts_with("HTTP/1.1 200 OK"));
    CHECK(received.find("text/event-stream") != std::string::npos);
    CHECK(received.find("HTTP/1.1 405 ") != std::string::npos);
    CHECK(received.find("Allow: GET, HEAD") != std::string::npos);
    CHECK(it.server->snapshots == 0);
}

TEST_CASE("http: thousands of connections that say nothing or little are bounded, and go in time") {
    ise::http_limits limits;
    limits.max_connections = 200;
    harbour it(limits);
    constexpr std::size_t count = 2000;
    std::vector<std::unique_ptr<ise::stream>> lines(count);
    it.user([&](ise::component& self) -> ise::task<> {
        auto at = place("shore", 8080);
        for (auto& line : lines) {
            auto connected = co_await self.env().connect(self.on(), at);
            line = std::move(connected.value());
            std::string_view text = "GET / HT";
            asio::const_buffer all(text.data(), text.size());
            line->try_write(std::span(&all, 1));
        }
        co_await self.sleep(24h);
    });
    REQUIRE(it.world.run_until([&] { return it.server->server->statistics().connections == count; }, 10min));
    CHECK(it.server->server->statistics().open_connections <= 200);
    harbour::outcome answer;
    it.ask("hello", answer, 5s);
    REQUIRE(it.world.run_until([&] { return answer.has_value(); }));
    CHECK((*answer)->status == 200);
    REQUIRE(it.world.run_until([&] { return it.server->server->statistics().open_connections == 0; }, 1min));
}

} // namespace server_test
