#include <components/web_server/assets.hpp>
#include <components/web_server/gzip.hpp>
#include <components/web_server/tile_source.hpp>
#include <components/web_server/web_component.hpp>

#include <ise/core/error.hpp>
#include <unit/http/client.hpp>

#include <support/catch.hpp>
#include <support/no_descriptors.hpp>

#include <memory>
#include <string>
#include <vector>

namespace http_server_test {

using web_test::another_host;
using web_test::client;

namespace {
bool has(const std::string& text, std::string_view part) { return text.find(part) != std::string::npos; }

struct site : web_test::grounds {
    explicit site(ise::http_limits limits = atirma::page_limits(), const std::string& address = "127.0.0.1")
        : server(host->loop(), log, limits, spawner()) {
        server.serve(atirma::page_assets());
        server.get("/hello", [](const ise::http_request& asked) {
            return ise::http_response{"hello " + asked.query, "text/plain"};
        });
        server.get("/file", [](const auto&) { return ise::http_response{"x", "text/plain", 200, "a\"\r\nX: y.txt"}; });
        server.get("/broken", [](const auto&) -> ise::http_response { throw std::runtime_error("secret detail"); });
        server.listen(web_test::any_port(address)).value();
    }
    ise::http_server server;
};
} // namespace

TEST_CASE("the page and Leaflet are served from the binary with their types and with security headers") {
    site s;
    REQUIRE(s.server.where().port != 0);
    client c(s.context, s.server.where().port);
    c.get("/");
    auto& page = c.read_answer();
    CHECK(has(page, "HTTP/1.1 200 OK"));
    CHECK(has(page, "Content-Type: text/html; charset=utf-8"));
    CHECK(has(page, "Content-Security-Policy: default-src 'self'"));
    CHECK(has(page, "X-Content-Type-Options: nosniff"));
    CHECK(has(page, "<!doctype html>"));
    c.received.clear();
    c.get("/app.js"); // the same connection goes on
    CHECK(has(c.read_answer(), "Content-Type: text/javascript"));
    CHECK(c.received.size() > 100000);
}

TEST_CASE("a file that the client has is not sent again, and compressed where the client takes it") {
    site s;
    client c(s.context, s.server.where().port);
    c.get("/app.css", "Accept-Encoding: br, gzip\r\n");
    auto packed = c.read_answer();
    CHECK(has(packed, "Content-Encoding: gzip"));
    CHECK(has(packed, "Vary: Accept-Encoding"));
    auto at = packed.find("ETag: ") + 6;
    auto tag = packed.substr(at, packed.find("\r\n", at) - at);
    c.received.clear();
    c.get("/app.css", "Accept-Encoding: gzip\r\nIf-None-Match: " + tag + "\r\n");
    auto unchanged = c.read_answer(true);
    CHECK(has(unchanged, "304 Not Modified"));
    CHECK(unchanged.substr(unchanged.find("\r\n\r\n")) == "\r\n\r\n");
    c.received.clear();
    c.get("/app.css", "Accept-Encoding: gzip;q=0\r\nIf-None-Match: " + tag + "\r\n"); // another representation
    auto plain = c.read_answer();
    CHECK(has(plain, "200 OK"));
    CHECK_FALSE(has(plain, "Content-Encoding"));
}

TEST_CASE("a handler's answer has a compressed form and a tag, too, and pictures may come from where the page says") {
    site s;
    std::string text(5000, 'x');
    s.server.get("/whole.json", [&](const ise::http_request&) {
        ise::http_response made{text, "application/json"};
        made.gzip = atirma::gzip(text);
        made.etag = "\"7\"";
        return made;
    });
    s.server.allow_images("https://tiles.example.org");
    client c(s.context, s.server.where().port);
    c.get("/whole.json", "Accept-Encoding: gzip\r\n");
    auto packed = c.read_answer();
    CHECK(has(packed, "Content-Encoding: gzip"));
    CHECK(has(packed, "Vary: Accept-Encoding"));
    CHECK(has(packed, "Cache-Control: no-cache"));
    CHECK(has(packed, "ETag: \"7-gz\""));
    CHECK(has(packed, "img-src 'self' data: https://tiles.example.org;"));
    CHECK(packed.size() < 1500);
    c.received.clear();
    c.get("/whole.json", "Accept-Encoding: gzip\r\nIf-None-Match: \"7-gz\"\r\n");
    CHECK(has(c.read_answer(true), "304 Not Modified"));
    c.received.clear();
    c.get("/whole.json");
    auto plain = c.read_answer();
    CHECK_FALSE(has(plain, "Content-Encoding"));
    CHECK(has(plain, text));
}

TEST_CASE("the address of map tiles is one that a policy can name") {
    using atirma::tile_source;
    CHECK_NOTHROW(atirma::check(tile_source{}));
    CHECK_NOTHROW(atirma::check({"https://tiles.example.org:8443/{z}/{x}/{y}.png?k=1", "them"}));
    CHECK(atirma::origin_of("https://tiles.example.org:8443/{z}/{x}/{y}.png") == "https://tiles.example.org:8443");
    for (auto url : {"ftp://a/{z}/{x}/{y}", "https://a;b/{z}/{x}/{y}", "https://a b/{z}/{x}/{y}", "https://a/{z}/{x}",
                     "/{z}/{x}/{y}"})
        CHECK_THROWS_WITH(atirma::check({url, ""}), ise_test::Contains("--tiles"));
}

TEST_CASE("HEAD answers as GET does, without the body") {
    site s;
    client c(s.context, s.server.where().port);
    c.get("/hello", "", "HEAD");
    c.get("/hello?you");
    c.read_until("hello you");
    auto first = c.received.substr(0, c.received.find("HTTP/1.1", 1));
    CHECK(has(first, "Content-Length: 6"));
    CHECK(first.substr(first.find("\r\n\r\n") + 4).empty());
}

TEST_CASE("what is not there is 404, writing is 405, a handler that throws is 500 without its text") {
    site s;
    for (auto [method, path, status] :
         {std::tuple("GET", "/../etc/passwd", "404"), std::tuple("GET", "/index.htm", "404"),
          std::tuple("DELETE", "/", "405"), std::tuple("GET", "/broken", "500")}) {
        client c(s.context, s.server.where().port);
        c.get(path, "", method);
        auto& answer = c.read_answer();
        INFO(path);
        CHECK(has(answer, std::string("HTTP/1.1 ") + status));
        CHECK(has(answer, "Content-Security-Policy"));
        CHECK_FALSE(has(answer, "secret detail"));
    }
    CHECK(has(s.logged, "GET /broken failed: secret detail"));
    CHECK(s.server.statistics().handlers_failed == 1);
    client c(s.context, s.server.where().port);
    c.send("POST / HTTP/1.1\r\nHost: test\r\nContent-Length: 2\r\n\r\nhi");
    CHECK(has(c.read_answer(), "Allow: GET, HEAD"));
}

TEST_CASE("a file name for download cannot forge a header") {
    site s;
    client c(s.context, s.server.where().port);
    c.get("/file");
    CHECK(has(c.read_answer(), "Content-Disposition: attachment; filename=\"a___X__y.txt\"\r\n"));
}

TEST_CASE("a port that is taken is a clear error that names it, and listening works later") {
    site s;
    web_test::grounds other;
    const auto taken = s.server.where();
    ise::http_server second(other.host->loop(), other.log, {}, other.spawner());
    auto refused = second.listen(taken);
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == ise::errc::address_in_use);
    CHECK(has(refused.error().message(), "127.0.0.1:" + std::to_string(taken.port)));
    CHECK(second.where().port == 0);
    s.server.stop();
    second.listen(taken).value();
    CHECK(second.where() == taken);
}

TEST_CASE("it listens on IPv6 and writes its address as browsers want it") {
    web_test::grounds here;
    ise::http_server server(here.host->loop(), here.log, {}, here.spawner());
    if (auto listening = server.listen(web_test::any_port("::1")); !listening) {
        WARN("no IPv6 on this machine, not tested: " << listening.error().message());
        return;
    }
    CHECK(server.url() == "http://[::1]:" + std::to_string(server.where().port) + "/");
}

TEST_CASE("too large headers, too many of them, and garbage end the connection") {
    site s;
    std::string many;
    for (int i = 0; i < 100; ++i) many += "X-" + std::to_string(i) + ": y\r\n";
    for (const std::string& hostile :
         {"GET / HTTP/1.1\r\nX: " + std::string(10000, 'a') + "\r\n\r\n",
          "GET /" + std::string(5000, 'a') + " HTTP/1.1\r\n\r\n", "GET / HTTP/1.1\r\n" + many + "\r\n",
          std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc", 9) + "\r\n\r\n",
          std::string("POST / HTTP/1.1\r\nContent-Length: 99999\r\n\r\n") + std::string(9000, 'b')}) {
        client c(s.context, s.server.where().port);
        c.send(hostile);
        c.read_to_end();
        CHECK_FALSE(has(c.received, "200 OK"));
    }
    client c(s.context, s.server.where().port); // and nobody else noticed
    c.get("/hello");
    CHECK(has(c.read_answer(), "200 OK"));
}

TEST_CASE(
    "page: beyond the limit the oldest idle connection of the host with the most is closed, and never another host's") {
    const auto elsewhere = another_host();
    if (elsewhere.empty()) return;
    auto limits = atirma::page_limits();
    limits.max_connections = 3;
    site s(limits, "0.0.0.0");
    client viewer(s.context, s.server.where().port, elsewhere);
    viewer.get("/hello");
    viewer.read_answer();
    std::vector<std::unique_ptr<client>> crowd;
    for (int i = 0; i < 20; ++i) {
        crowd.push_back(std::make_unique<client>(s.context, s.server.where().port));
        if (i % 2 == 0) crowd.back()->send("GET / HT"); // half of them begin and do not go on
        s.turn();
    }
    while (s.server.statistics().connections < 21) s.turn();
    for (int i = 0; i < 18; ++i) CHECK(crowd[static_cast<std::size_t>(i)]->read_to_end().empty());
    CHECK(s.server.statistics().connections_displaced == 18);
    viewer.received.clear();
    viewer.get("/hello");
    CHECK(has(viewer.read_answer(), "200 OK"));
    client late(s.context, s.server.where().port, elsewhere);
    late.get("/hello");
    CHECK(has(late.read_answer(), "200 OK"));
}

TEST_CASE("page: out of descriptors it closes whoever waits, and answers again") {
#if defined(__has_feature)
    #if __has_feature(undefined_behavior_sanitizer)
    return ise_test::skip("the sanitizer needs descriptors itself");
    #endif
#endif
    site s;
    auto crowd = std::make_unique<std::vector<std::unique_ptr<client>>>();
    for (int i = 0; i < 5; ++i) crowd->push_back(std::make_unique<client>(s.context, s.server.where().port));
    client viewer(s.context, s.server.where().port); // waits in the kernel, as the others do
    ise_test::no_descriptors full;
    viewer.get("/hello");
    while (!has(s.logged, "ulimit -n")) s.context.restart(), s.context.run_one();
    CHECK(s.server.statistics().connections == 0);
    full.end();
    CHECK(has(viewer.read_answer(), "200 OK"));
}

TEST_CASE("a request that is never finished is told so and cut off") {
    auto limits = atirma::page_limits();
    limits.times.request = std::chrono::seconds(1);
    site s(limits);
    client c(s.context, s.server.where().port);
    c.send("GET / HTTP/1.1\r\nHost: te");
    CHECK(has(c.read_to_end(), "HTTP/1.1 408 Request Timeout"));
}

} // namespace http_server_test
