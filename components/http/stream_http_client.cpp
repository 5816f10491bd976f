#include <components/http/stream_http_client.hpp>

#include <components/http/http_reader.hpp>
#include <components/http/line_with_deadline.hpp>

#include <ise/net/connect.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

#include <array>
#include <charconv>

namespace atirma {
namespace {

std::string request_text(const http_exchange& what, const http_url& to) {
    auto text = fmt::format("{} {} HTTP/1.1\r\nHost: {}:{}\r\nConnection: close\r\nContent-Length: {}\r\n", what.method,
                            to.target, to.host, to.port, what.body.size());
    for (const auto& [name, value] : what.headers) text += fmt::format("{}: {}\r\n", name, value);
    return text + "\r\n" + what.body;
}

bool one_line(std::string_view text) { return text.find_first_of("\r\n") == std::string_view::npos; }

} // namespace

ise::result<http_url> parse_http_url(std::string_view url) {
    auto wrong = [&](std::string_view why) {
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("'{}' {}; a right one is http://host:8080/path", url.substr(0, 200), why));
    };
    constexpr std::string_view scheme = "http://";
    if (url.starts_with("https://")) return wrong("needs TLS, which this client has not");
    if (!url.starts_with(scheme) || url.find_first_of(" \t\r\n") != std::string_view::npos)
        return wrong("is not an http URL");
    url.remove_prefix(scheme.size());
    auto slash = url.find_first_of("/?");
    auto authority = url.substr(0, slash);
    http_url out;
    if (slash != std::string_view::npos) out.target = url.substr(slash);
    if (out.target.starts_with('?')) out.target = fmt::format("/{}", out.target);
    std::string_view port;
    if (authority.starts_with('[')) {
        auto end = authority.find(']');
        if (end == std::string_view::npos) return wrong("has an address without its bracket");
        out.host = authority.substr(1, end - 1);
        port = authority.substr(end + 1);
    } else {
        auto colon = authority.find(':');
        out.host = authority.substr(0, colon);
        port = colon == std::string_view::npos ? std::string_view() : authority.substr(colon);
    }
    if (out.host.empty()) return wrong("names no host");
    if (!port.empty()) {
        port.remove_prefix(1);
        auto [end, problem] = std::from_chars(port.data(), port.data() + port.size(), out.port);
        if (problem != std::errc() || end != port.data() + port.size() || out.port == 0)
            return wrong("has no good port");
    }
    return out;
}

ise::task<ise::result<http_answer>> stream_http_client::exchange(http_exchange what, ise::duration within) {
    auto deadline = ise::saturating_add(loop_.now(), within);
    auto to = parse_http_url(what.url);
    if (!to) co_return to.error();
    bool clean = one_line(what.method) && one_line(to->target);
    for (const auto& [name, value] : what.headers) clean = clean && one_line(name) && one_line(value);
    if (!clean) co_return ise::failure(ise::errc::invalid_argument, "a line break in a method or header");
    ise::endpoint peer;
    peer.host = to->host;
    peer.port = to->port;
    auto connected = co_await ise::net::connect_until(loop_, peer, deadline);
    if (!connected) co_return ise::failure(ise::errc::unreachable, connected.error().message()); // nothing was sent
    line_with_deadline line(loop_, std::move(*connected));
    line.until(deadline);
    auto lost = [&](const std::error_code& cause) {
        auto code = cause == asio::error::timed_out ? ise::errc::timed_out : ise::errc::peer_lost;
        return ise::failure(
            code, fmt::format("{}: {}", what.url, code == ise::errc::timed_out ? "no answer in time" : cause.message()),
            ise::execution::unknown);
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
        auto rest = ise::bytes_view(buffer).first(got.bytes);
        while (!rest.empty()) {
            auto used = reader.feed(rest);
            if (!used)
                co_return ise::failure(used.error().code(), what.url + ": " + used.error().message(),
                                       ise::execution::unknown);
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

} // namespace atirma
