#include <ise/http/stream_http_client.hpp>

#include <ise/http/http_reader.hpp>
#include <ise/http/line_with_deadline.hpp>

#include <ise/core/url.hpp>
#include <ise/net/connect.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/format.h>

#include <array>

namespace ise {
namespace {

std::string request_text(const http_exchange& what, const http_url& to) {
    auto text = fmt::format("{} {} HTTP/1.1\r\nHost: {}:{}\r\nConnection: close\r\nContent-Length: {}\r\n", what.method,
                            to.target, to.host, to.port, what.body.size());
    for (const auto& [name, value] : what.headers) text += fmt::format("{}: {}\r\n", name, value);
    return text + "\r\n" + what.body;
}

bool one_line(std::string_view text) { return text.find_first_of("\r\n") == std::string_view::npos; }

} // namespace

result<http_url> parse_http_url(std::string_view url) {
    auto wrong = [&](std::string_view why) {
        return failure(errc::invalid_argument,
                       fmt::format("'{}' {}; a right one is http://host:8080/path", url.substr(0, 200), why));
    };
    auto parts = parse_url(url);
    if (!parts) return wrong("is not an http URL");
    if (parts->scheme == "https") return wrong("needs TLS, which this client has not");
    if (parts->scheme != "http") return wrong("is not an http URL");
    if (parts->port == 0) return wrong("has no good port");
    http_url out;
    out.host = std::move(parts->host);
    out.port = parts->port;
    if (!parts->target.empty()) out.target = std::move(parts->target);
    if (out.target.starts_with('?')) out.target = fmt::format("/{}", out.target);
    return out;
}

task<result<http_answer>> stream_http_client::exchange(http_exchange what, duration within) {
    auto deadline = saturating_add(loop_.now(), within);
    auto to = parse_http_url(what.url);
    if (!to) co_return to.error();
    bool clean = one_line(what.method) && one_line(to->target);
    for (const auto& [name, value] : what.headers) clean = clean && one_line(name) && one_line(value);
    if (!clean) co_return failure(errc::invalid_argument, "a line break in a method or header");
    endpoint peer;
    peer.host = to->host;
    peer.port = to->port;
    auto connected = co_await net::connect_until(loop_, peer, deadline);
    if (!connected) co_return failure(errc::unreachable, connected.error().message()); // nothing was sent
    line_with_deadline line(loop_, std::move(*connected));
    line.until(deadline);
    auto lost = [&](const std::error_code& cause) {
        auto code = cause == asio::error::timed_out ? errc::timed_out : errc::peer_lost;
        return failure(code,
                       fmt::format("{}: {}", what.url, code == errc::timed_out ? "no answer in time" : cause.message()),
                       execution::unknown);
    };
    auto text = request_text(what, *to);
    auto unsent = co_await line.write_all(text);
    if (unsent) co_return lost(unsent);
    http_reader_limits limits;
    limits.max_body_bytes = max_answer_bytes;
    http_reader reader(http_reader::reads::answers, limits);
    std::array<std::byte, 4096> buffer;
    for (;;) {
        auto got = co_await line.read_some(asio::buffer(buffer));
        auto rest = bytes_view(buffer).first(got.bytes);
        while (!rest.empty()) {
            auto used = reader.feed(rest);
            if (!used)
                co_return failure(used.error().code(), what.url + ": " + used.error().message(), execution::unknown);
            rest = rest.subspan(*used);
            bool interim = reader.complete();
            if (!interim) continue;
            auto whole = reader.take();
            if (whole.status < 200) continue; // 100 Continue
            http_answer answer;
            answer.status = whole.status;
            answer.headers = std::move(whole.headers);
            answer.body = std::move(whole.body);
            co_return answer;
        }
        if (got.problem == asio::error::eof) {
            auto ended = reader.end();
            if (!ended) co_return lost(asio::error::eof);
            auto whole = reader.take();
            http_answer answer;
            answer.status = whole.status;
            answer.headers = std::move(whole.headers);
            answer.body = std::move(whole.body);
            co_return answer;
        }
        if (got.problem) co_return lost(got.problem);
    }
}

} // namespace ise
