#include <ise/http/http_reader.hpp>
#include <ise/http/stream_http_client.hpp>

#include <support/catch.hpp>

namespace reader_test {

using namespace ise;

namespace {

constexpr std::string_view post =
    "POST /mo?x=1 HTTP/1.1\r\nHost: a\r\nContent-Type: text/plain\r\nX-Long: a\r\nContent-Length: 5\r\n\r\nhello";

ise::result<std::size_t> feed(ise::http_reader& to, std::string_view text) { return to.feed(ise::as_bytes(text)); }

ise::errc refusal(std::string_view text, ise::http_reader_limits limits = {}) {
    ise::http_reader reader(ise::http_reader::reads::requests, limits);
    auto outcome = feed(reader, text);
    REQUIRE_FALSE(outcome);
    CHECK_FALSE(feed(reader, "GET / HTTP/1.1\r\n\r\n")); // of no more use
    return outcome.error().code();
}

} // namespace

TEST_CASE("http: a request is read however its bytes are cut") {
    for (std::size_t piece = 1; piece <= post.size(); piece += piece < 8 ? 1 : 31) {
        ise::http_reader reader(ise::http_reader::reads::requests, {});
        for (std::size_t at = 0; at < post.size(); at += piece) {
            auto text = post.substr(at, piece);
            CHECK_FALSE(reader.complete());
            CHECK(feed(reader, text).value() == text.size());
        }
        REQUIRE(reader.complete());
        auto message = reader.take();
        CHECK(message.method == "POST");
        CHECK(message.target == "/mo?x=1");
        CHECK(message.header("content-type") == "text/plain");
        CHECK(message.header("nothing").empty());
        CHECK(message.body == "hello");
        CHECK(message.keep_alive);
    }
}

TEST_CASE("http: what follows a request is left for the next one") {
    ise::http_reader reader(ise::http_reader::reads::requests, {});
    auto two = std::string(post) + "GET /next HTTP/1.1\r\nConnection: close\r\n\r\n";
    auto used = feed(reader, two).value();
    CHECK(used == post.size());
    CHECK(reader.take().body == "hello");
    feed(reader, std::string_view(two).substr(used)).value();
    REQUIRE(reader.complete());
    auto next = reader.take();
    CHECK(next.target == "/next");
    CHECK_FALSE(next.keep_alive);
}

TEST_CASE("http: chunks make a body, and an answer without a length ends with its stream") {
    ise::http_reader request(ise::http_reader::reads::requests, {});
    feed(request, "POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n2\r\nde\r\n0\r\n\r\n").value();
    REQUIRE(request.complete());
    CHECK(request.take().body == "abcde");
    ise::http_reader answer(ise::http_reader::reads::answers, {});
    feed(answer, "HTTP/1.1 200 OK\r\n\r\nOK,41").value();
    CHECK_FALSE(answer.complete());
    REQUIRE(answer.end());
    auto whole = answer.take();
    CHECK(whole.status == 200);
    CHECK(whole.body == "OK,41");
    ise::http_reader cut(ise::http_reader::reads::answers, {});
    feed(cut, "HTTP/1.1 200 OK\r\nContent-Length: 10\r\n\r\nOK").value();
    CHECK_FALSE(cut.end());
}

TEST_CASE("http: a sender that waits for 100 Continue is seen once") {
    ise::http_reader reader(ise::http_reader::reads::requests, {});
    feed(reader, "POST / HTTP/1.1\r\nExpect: 100-continue\r\nContent-Length: 2\r\n\r\n").value();
    CHECK(reader.wants_continue());
    CHECK_FALSE(reader.wants_continue());
    feed(reader, "ok").value();
    CHECK(reader.take().body == "ok");
}

TEST_CASE("http: what is no HTTP, or too much of it, is refused") {
    CHECK(refusal("\x16\x03\x01\x02") == ise::errc::malformed);
    CHECK(refusal("GET / HTTP/9.9.9\r\n\r\n") == ise::errc::malformed);
    CHECK(refusal("POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n") == ise::errc::malformed);
    CHECK(refusal("POST / HTTP/1.1\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n") == ise::errc::malformed);
    ise::http_reader_limits small;
    small.max_head_bytes = 100;
    small.max_headers = 3;
    small.max_body_bytes = 10;
    CHECK(refusal("GET /" + std::string(200, 'a') + " HTTP/1.1\r\n\r\n", small) == ise::errc::too_large);
    CHECK(refusal("GET / HTTP/1.1\r\nA: 1\r\nB: 1\r\nC: 1\r\nD: 1\r\n\r\n", small) == ise::errc::too_large);
    CHECK(refusal("POST / HTTP/1.1\r\nContent-Length: 11\r\n\r\n", small) == ise::errc::too_large);
    CHECK(refusal("POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nB\r\nabcdefghijk\r\n", small) ==
          ise::errc::too_large);
}

TEST_CASE("http: URLs are taken apart, others are refused with a right one") {
    auto url = ise::parse_http_url("http://gateway:8080/rockblock/MT?x=1").value();
    CHECK(url.host == "gateway");
    CHECK(url.port == 8080);
    CHECK(url.target == "/rockblock/MT?x=1");
    CHECK(ise::parse_http_url("http://a").value().target == "/");
    CHECK(ise::parse_http_url("http://a?b").value().target == "/?b");
    CHECK(ise::parse_http_url("http://[::1]:81/").value().host == "::1");
    for (auto wrong : {"", "ftp://a", "http://", "http://:80/", "http://a:b/", "http://a:0/", "http://a:99999/",
                       "http://a/ b", "http://[::1/"})
        CHECK(ise::parse_http_url(wrong).error().code() == ise::errc::invalid_argument);
    CHECK(ise::parse_http_url("https://a/").error().message().find("TLS") != std::string::npos);
}

} // namespace reader_test
