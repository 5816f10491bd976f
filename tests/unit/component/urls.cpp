#include <ise/core/url.hpp>

#include <support/catch.hpp>

using namespace ise;

TEST_CASE("a URL is split into scheme, host, port and target") {
    auto post = parse_url("HTTPS://Gateway.example/rockblock/MT?x=1#top").value();
    CHECK(post.scheme == "https");
    CHECK(post.host == "gateway.example");
    CHECK(post.port == 443);
    CHECK(post.target == "/rockblock/MT?x=1");
    CHECK(post.server() == "https://gateway.example:443");
    CHECK(parse_url("imaps://[::1]:1993").value().server() == "imaps://[::1]:1993");
    CHECK(parse_url("ftp://host?query").value().server() == "ftp://host");
    CHECK(parse_url("ftp://host?query").value().target == "?query");
    for (auto text : {"host", "://host", "tcp://", "tcp://user@host", "tcp://host:65536", "tcp://[::1", "tcp://a b",
                      "tcp://a\\b"}) {
        INFO(text);
        CHECK(parse_url(text).error().code() == errc::invalid_argument);
    }
}

TEST_CASE("a URL of a transport whose endpoints are names has no host") {
    for (auto text : {"local:///run/boat.sock", "inproc://name", "file:///etc/passwd"}) {
        INFO(text);
        CHECK(parse_url(text).value().host.empty());
    }
    CHECK(parse_url("udp://10.0.0.1:7").value().host == "10.0.0.1");
}
