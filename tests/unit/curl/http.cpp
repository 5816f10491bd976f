#include "scripted_server.hpp"

#include <components/curl/curl_http_client.hpp>

#include <ise/component/node.hpp>
#include <ise/sim/world.hpp>
#include <support/catch.hpp>

namespace http_test {

using namespace atirma;
using namespace curl_test;
using namespace std::chrono_literals;
using namespace std::string_literals;

namespace {

struct shore {
    ise_test::real_parties all;
    ise_test::party& here = all.add("shore");
    curl_transfers transfers{here.on};
    curl_http_client client{transfers, trusting()};

    static curl_http_options trusting() {
        curl_http_options made;
        made.ca_file = certificates::made().file("server.pem");
        return made;
    }
    ise::result<ise::http_answer> get(std::string url, ise::duration within = 1min) {
        ise::http_exchange what;
        what.url = std::move(url);
        return ask(std::move(what), within);
    }
    ise::result<ise::http_answer> ask(ise::http_exchange what, ise::duration within = 1min) {
        return all.run(here, client.exchange(std::move(what), within));
    }
};

ise::task<> greet(visitor& who) {
    co_await who.head();
    co_await who.say("HTTP/1.1 200 OK\r\nContent-Length: 5\r\nX-Credits:  17 \r\n\r\nhello");
}

ise::http_exchange post(std::string url) {
    ise::http_exchange made;
    made.method = "POST";
    made.url = std::move(url);
    made.headers = {{"Content-Type", "application/x-www-form-urlencoded"}, {"X-Empty", ""}};
    made.body = "imei=300034012345678&data=00ff";
    return made;
}

} // namespace

TEST_CASE("a request reaches the server as it was meant, and so does its answer") {
    shore s;
    std::string head, body;
    scripted_server server(s.all, s.here, [&](visitor& who) -> ise::task<> {
        head = co_await who.head();
        body = co_await who.bytes(30);
        co_await who.say("HTTP/1.1 404 Not Found\r\nX-What: FAILED\r\nContent-Length: 3\r\n\r\n\0\r\n"s);
    });
    auto answer = s.ask(post(server.at("http", "/rockblock/MT?x=1")));
    REQUIRE(answer);
    CHECK(head.starts_with("POST /rockblock/MT?x=1 HTTP/1.1\n"));
    CHECK(head.find("Content-Type: application/x-www-form-urlencoded\n") != std::string::npos);
    CHECK(head.find("X-Empty:") != std::string::npos);
    CHECK(head.find("Expect") == std::string::npos);
    CHECK(body == "imei=300034012345678&data=00ff");
    CHECK(answer->status == 404);
    CHECK(answer->headers.at(0) == std::pair<std::string, std::string>("x-what", "FAILED"));
    CHECK(answer->body.size() == 3);
}

TEST_CASE("a server with a trusted certificate is talked to") {
    shore s;
    scripted_server server(s.all, s.here, greet, "server");
    auto answer = s.get(server.at("https", "/"));
    REQUIRE(answer);
    CHECK(answer->body == "hello");
    CHECK(answer->headers.at(1) == std::pair<std::string, std::string>("x-credits", "17"));
}

TEST_CASE("a server with another's certificate, or one that nobody vouches for, hears nothing") {
    shore s;
    bool heard = false;
    auto listening = [&](visitor& who) -> ise::task<> {
        auto head = co_await who.head();
        heard = heard || !head.empty();
    };
    scripted_server stranger(s.all, s.here, listening, "other");
    auto answer = s.get(stranger.at("https"));
    REQUIRE_FALSE(answer);
    CHECK(answer.error().code() == ise::errc::unreachable);
    CHECK(answer.error().executed() == ise::execution::not_executed);
    CHECK(answer.error().message().find("certificate") != std::string::npos);

    // Trusted, but it belongs to another name.
    curl_http_options options;
    options.ca_file = certificates::made().file("other.pem");
    curl_http_client trusting(s.transfers, options);
    ise::http_exchange what;
    what.url = stranger.at("https");
    answer = s.all.run(s.here, trusting.exchange(what, 1min));
    REQUIRE_FALSE(answer);
    CHECK(answer.error().code() == ise::errc::unreachable);
    CHECK_FALSE(heard);
}

TEST_CASE("a CA file that is not there is said so") {
    shore s;
    scripted_server server(s.all, s.here, greet, "server");
    curl_http_options options;
    options.ca_file = "/nowhere/ca.pem";
    curl_http_client client(s.transfers, options);
    ise::http_exchange what;
    what.url = server.at("https");
    auto answer = s.all.run(s.here, client.exchange(what, 1min));
    REQUIRE_FALSE(answer);
    CHECK(answer.error().code() == ise::errc::invalid_argument);
    CHECK(answer.error().message().find("/nowhere/ca.pem") != std::string::npos);
}

TEST_CASE("a server that goes away before or in its answer is told as lost, and asked once only") {
    shore s;
    auto said = GENERATE(as<std::string>(), "", "HTTP/1.1 200 OK\r\nContent-Le",
                         "HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nhalf of it");
    scripted_server server(s.all, s.here, [&](visitor& who) -> ise::task<> {
        co_await who.head();
        co_await who.bytes(30);
        if (!said.empty()) co_await who.say(said);
    });
    auto answer = s.ask(post(server.at("http")));
    REQUIRE_FALSE(answer);
    CHECK(answer.error().code() == ise::errc::peer_lost);
    CHECK(answer.error().executed() == ise::execution::unknown);
    CHECK(server.visitors.size() == 1);
}

TEST_CASE("two requests have two connections: none is repeated on a dead one") {
    shore s;
    scripted_server server(s.all, s.here, greet);
    REQUIRE(s.get(server.at("http")));
    REQUIRE(s.get(server.at("http")));
    CHECK(server.visitors.size() == 2);
}

TEST_CASE("where nobody listens nothing was sent") {
    shore s;
    std::string nowhere;
    {
        scripted_server gone(s.all, s.here, greet);
        nowhere = gone.at("http");
    }
    auto answer = s.get(nowhere);
    REQUIRE_FALSE(answer);
    CHECK(answer.error().code() == ise::errc::unreachable);
    CHECK(answer.error().executed() == ise::execution::not_executed);
    CHECK(s.get("http://no-such-host.invalid/").error().code() == ise::errc::unreachable);
}

TEST_CASE("a server that does not answer in time is told, without its query") {
    shore s;
    scripted_server server(s.all, s.here, [](visitor& who) { return who.silence(); });
    auto answer = s.get(server.at("http", "/?password=secret"), 3s);
    REQUIRE_FALSE(answer);
    CHECK(answer.error().code() == ise::errc::timed_out);
    CHECK(answer.error().executed() == ise::execution::unknown);
    CHECK(answer.error().message().find("secret") == std::string::npos);
    s.all.run_until([&] { return server.visitors.front().ended; }); // it was hung up on
}

TEST_CASE("an answer without end is cut off") {
    shore s;
    auto part = GENERATE(as<std::string>(), "body", "headers");
    scripted_server server(s.all, s.here, [&](visitor& who) -> ise::task<> {
        co_await who.head();
        co_await who.say(part == "body" ? "HTTP/1.1 200 OK\r\n\r\n" : "HTTP/1.1 200 OK\r\n");
        std::string more = part == "body" ? std::string(10000, 'x') : "X-More: " + std::string(10000, 'x') + "\r\n";
        for (bool there = true; there;) there = co_await who.say(more);
    });
    auto answer = s.get(server.at("http"));
    REQUIRE_FALSE(answer);
    CHECK(answer.error().code() == ise::errc::too_large);
}

TEST_CASE("nonsense instead of an answer is an error") {
    shore s;
    scripted_server server(s.all, s.here, [](visitor& who) -> ise::task<> {
        co_await who.head();
        co_await who.say(std::string("\x00\xff\r\n\r\nSSH-2.0-OpenSSH\r\n", 23));
    });
    CHECK_FALSE(s.get(server.at("http")));
    scripted_server tls(s.all, s.here, greet, "server");
    CHECK_FALSE(s.get(tls.at("http"))); // plain text to a TLS server
    scripted_server plain(s.all, s.here, [](visitor& who) -> ise::task<> { co_await who.say("220 ready\r\n"); });
    CHECK(s.get(plain.at("https")).error().code() == ise::errc::unreachable);
}

TEST_CASE("requests that cannot be are not sent") {
    shore s;
    scripted_server server(s.all, s.here, greet);
    ise::http_exchange bad_method, bad_header, bad_value;
    bad_method.url = bad_header.url = bad_value.url = server.at("http");
    bad_method.method = "GET / HTTP/1.1\r\nX:";
    bad_header.headers = {{"X\r\nY", "1"}};
    bad_value.headers = {{"X", "1\r\nY: 2"}};
    for (const auto& what : {bad_method, bad_header, bad_value})
        CHECK(s.ask(what).error().code() == ise::errc::invalid_argument);
    for (std::string url :
         {"", "file:///etc/passwd", "ftp://localhost/", "http://", "http://a b/", "gopher://localhost/"}) {
        CAPTURE(url);
        CHECK(s.get(url).error().code() == ise::errc::invalid_argument);
    }
    CHECK(server.visitors.empty());
}

TEST_CASE("an exchange that is given up ends its connection") {
    shore s;
    scripted_server server(
        s.all, s.here, [](visitor& who) { return who.silence(); }, "server");
    ise::http_exchange what;
    what.url = server.at("https");
    auto asking = ise_test::start(s.here.on, s.client.exchange(what, 1h));
    s.all.run_until([&] { return !server.visitors.empty() && !server.visitors.front().heard.empty(); });
    asking->cancel.emit(asio::cancellation_type::terminal);
    s.all.run_until([&] { return asking->done && server.visitors.front().ended; });
    CHECK(asking->code() == ise::errc::cancelled);
}

TEST_CASE("many exchanges run side by side") {
    shore s;
    scripted_server server(s.all, s.here, greet, "server");
    std::vector<std::shared_ptr<ise_test::started<ise::result<ise::http_answer>>>> all;
    ise::http_exchange what;
    what.url = server.at("https");
    for (int i = 0; i < 20; ++i) all.push_back(ise_test::start(s.here.on, s.client.exchange(what, 1min)));
    s.all.run_until([&] { return std::all_of(all.begin(), all.end(), [](auto& one) { return one->done; }); });
    for (auto& one : all) CHECK(one->get().value().body == "hello");
}

TEST_CASE("a component that is stopped in the middle of an exchange ends, and its connection too") {
    shore s;
    scripted_server server(s.all, s.here, [](visitor& who) { return who.silence(); });
    ise::real_environment env;
    ise::node_options quiet;
    quiet.use_names = false;
    quiet.log = ise::log_sink();
    ise::node node(env, quiet);
    ise::component_options asks_only;
    asks_only.listens = false;
    auto url = server.at("http");
    node.start(
        "",
        [url](ise::component& self) -> ise::task<> {
            curl_transfers transfers(self.on());
            curl_http_client client(transfers);
            ise::http_exchange what;
            what.url = url;
            auto never = co_await client.exchange(what, 1h);
            self.log().info(never ? "answered" : never.error().message());
        },
        asks_only);
    s.all.run_until([&] { return !server.visitors.empty() && !server.visitors.front().heard.empty(); });
    node.stop();
    s.all.run_until([&] { return server.visitors.front().ended; });
    node.wait();
    for (const auto& one : node.components()) CHECK(one.state == ise::component_state::stopped);
}

TEST_CASE("libcurl is refused on the virtual clock") {
    ise::sim::world world;
    auto& process = world.host("shore").start_process("shore");
    auto loop = process.make_loop("main");
    CHECK_THROWS_AS(curl_transfers(loop->loop()), ise::error);
}

} // namespace http_test
