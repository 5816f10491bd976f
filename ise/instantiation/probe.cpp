#include <ise/instantiation/probe.hpp>

#include <ise/core/loop.hpp>
#include <ise/core/url.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>

namespace ise::instantiation {
namespace {

constexpr std::size_t max_probe_path = 1000;
constexpr std::size_t max_status_line = 4096;

failure no_probe(std::string_view text, std::string_view why) {
    return failure(
        errc::invalid_argument,
        fmt::format("'{}' is not a probe: {}; write it like tcp://127.0.0.1:8080 or http://127.0.0.1:8080/path",
                    text.substr(0, 200), why));
}

task<std::error_code> write_all_of(stream& to, std::string_view content) {
    while (!content.empty()) {
        asio::const_buffer piece(content.data(), content.size());
        auto moved = to.try_write(std::span(&piece, 1));
        content.remove_prefix(moved.bytes);
        if (!moved.problem) continue;
        if (moved.problem != asio::error::would_block) co_return moved.problem;
        auto problem = co_await to.wait_writable();
        if (problem) co_return problem;
    }
    co_return std::error_code();
}

// "HTTP/1.1 200 OK"
result<void> judge(const std::string& answer) {
    auto line = answer.substr(0, answer.find_first_of("\r\n"));
    auto space = line.find(' ');
    bool is_status = line.starts_with("HTTP/1.") && space != std::string::npos && space + 4 <= line.size();
    auto status = is_status ? line.substr(space + 1, 3) : std::string();
    if (is_status && (status.front() == '2' || status.front() == '3')) return {};
    std::string shown;
    for (char one : line.substr(0, 80))
        shown += static_cast<unsigned char>(one) < 0x20 || static_cast<unsigned char>(one) >= 0x7F ? '?' : one;
    return failure(errc::refused, is_status ? fmt::format("it answers {}", shown)
                                            : fmt::format("its answer is not HTTP: '{}'", shown));
}

} // namespace

result<probe_target> parse_probe(std::string_view text) {
    auto parts = parse_url(text);
    if (!parts) return no_probe(text, parts.error().message());
    probe_target made;
    made.http = parts->scheme == "http";
    if (!made.http && parts->scheme != "tcp") return no_probe(text, "it begins with neither tcp:// nor http://");
    if (!made.http && !parts->target.empty()) return no_probe(text, "a TCP endpoint has no path");
    made.path = parts->target.empty() ? "/" : parts->target;
    bool plain = std::ranges::all_of(made.path, [](unsigned char letter) { return letter > 0x20 && letter < 0x7F; });
    if (!plain || !made.path.starts_with('/') || made.path.size() > max_probe_path)
        return no_probe(text, "its path does not begin with /, has letters that belong in no URL, or too many");
    made.at.host = parts->host;
    made.at.port = parts->port;
    if (made.at.port == 0) return no_probe(text, "it has no port");
    return made;
}

task<result<void>> probe(loop& on, probe_target target, duration limit) {
    auto line = co_await on.env().connect(on, target.at);
    if (!line) co_return line.error();
    if (!target.http) co_return result<void>();
    bool late = false;
    timer alarm(on, [&] {
        late = true;
        (*line)->close();
    });
    alarm.arm(saturating_add(on.now(), limit));
    auto host = target.at.text().substr(std::string_view("tcp://").size());
    auto request = fmt::format("GET {} HTTP/1.1\r\nHost: {}\r\nUser-Agent: ise-probe\r\nConnection: close\r\n\r\n",
                               target.path, host);
    auto problem = co_await write_all_of(**line, request);
    std::string answer;
    std::array<char, 512> piece;
    while (!problem && answer.find('\n') == std::string::npos && answer.size() < max_status_line) {
        auto got = co_await (*line)->read_some(asio::buffer(piece));
        answer.append(piece.data(), got.bytes);
        problem = got.problem;
    }
    if (late)
        co_return failure(errc::timed_out,
                          fmt::format("no answer within {:g} s", std::chrono::duration<double>(limit).count()));
    if (problem && answer.empty())
        co_return failure(errc::unreachable,
                          fmt::format("it closed the connection without an answer: {}", problem.message()));
    co_return judge(answer);
}

} // namespace ise::instantiation
