#include <components/http/webhook_server.hpp>

#include <components/http/line_with_deadline.hpp>

#include <ise/core/sleep.hpp>

#include <asio/error.hpp>
#include <asio/this_coro.hpp>
#include <fmt/format.h>

#include <array>

namespace atirma {
namespace {

constexpr std::size_t most_turned_away = 32; // at a time; beyond it they are just closed
constexpr std::size_t most_dropped = 1 << 20;  // bytes of a request that was refused

std::string_view reason_of(int status) noexcept {
    switch (status) {
        case 200: return "OK";
        case 400: return "Bad Request";
        case 401: return "Unauthorized";
        case 403: return "Forbidden";
        case 404: return "Not Found";
        case 405: return "Method Not Allowed";
        case 408: return "Request Timeout";
        case 413: return "Payload Too Large";
        case 431: return "Request Header Fields Too Large";
        case 500: return "Internal Server Error";
        case 503: return "Service Unavailable";
        default: return "Status";
    }
}

std::string text_of(const webhook_answer& answer, bool keep) {
    return fmt::format(
        "HTTP/1.1 {} {}\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: {}\r\nConnection: {}\r\n\r\n{}",
        answer.status, reason_of(answer.status), answer.body.size(), keep ? "keep-alive" : "close", answer.body);
}

webhook_answer make_answer(int status, std::string body) {
    webhook_answer made;
    made.status = status;
    made.body = std::move(body);
    return made;
}

struct counted {
    std::size_t& count;
    explicit counted(std::size_t& of) : count(of) { ++count; }
    ~counted() { --count; }
};

} // namespace

webhook_server::webhook_server(ise::loop& on, ise::logger log, webhook_limits limits, handler answer, spawner spawn)
    : loop_(on), log_(std::move(log)), limits_(limits), answer_(std::move(answer)), spawn_(std::move(spawn)) {}

ise::result<void> webhook_server::listen(const ise::endpoint& at) {
    auto made = loop_.env().listen(loop_, at);
    if (!made) return made.error();
    listener_ = std::move(*made);
    return {};
}

ise::task<> webhook_server::run() {
    for (;;) {
        auto accepted = co_await listener_->accept();
        if (accepted.first == asio::error::operation_aborted) co_return;
        if (accepted.first) {
            note("a connection could not be accepted: " + accepted.first.message(), where().text());
            co_await ise::sleep_for(loop_, std::chrono::milliseconds(200)); // out of descriptors: others must end first
            continue;
        }
        auto line = std::move(accepted.second);
        auto name = "http " + line->peer();
        if (connections_ < limits_.max_connections) {
            spawn_(std::move(name), serve(std::move(line)));
            continue;
        }
        note(fmt::format("{} connections are open: another one is turned away", connections_), line->peer());
        if (turned_away_ < most_turned_away) spawn_(std::move(name), turn_away(std::move(line)));
    }
}

ise::task<> webhook_server::turn_away(std::unique_ptr<ise::stream> line) {
    counted here(turned_away_);
    line_with_deadline to(loop_, std::move(line));
    to.until(ise::saturating_add(loop_.now(), std::chrono::seconds(1)));
    auto text = text_of(make_answer(503, "too many connections\n"), false);
    co_await to.write_all(text);
}

/// A connection never takes the component down with it.
ise::task<> webhook_server::serve(std::unique_ptr<ise::stream> line) {
    counted here(connections_);
    auto peer = line->peer();
    std::string problem;
    try {
        co_await converse(std::move(line));
    } catch (const std::exception& why) {
        problem = why.what();
    }
    auto state = co_await asio::this_coro::cancellation_state;
    if (!problem.empty() && state.cancelled() == asio::cancellation_type::none)
        note("a connection ended: " + problem, peer);
}

ise::task<> webhook_server::converse(std::unique_ptr<ise::stream> stream) {
    auto peer = stream->peer();
    line_with_deadline line(loop_, std::move(stream));
    http_reader reader(http_reader::reads::requests, limits_.message);
    std::array<std::byte, 4096> buffer;
    ise::bytes_view rest;
    for (std::size_t served = 0; served < limits_.max_requests; ++served) {
        line.until(ise::saturating_add(loop_.now(), rest.empty() ? limits_.idle_time : limits_.request_time));
        bool timed = !rest.empty();
        while (!reader.complete()) {
            if (rest.empty()) {
                auto got = co_await line.read_some(asio::buffer(buffer));
                rest = ise::bytes_view(buffer).first(got.bytes);
                if (got.problem && rest.empty()) {
                    if (line.late() && timed) note("a request did not come to its end in time", peer);
                    co_return; // closed, or nothing came
                }
            }
            auto used = reader.feed(rest);
            if (!used) {
                bool big = used.error().code() == ise::errc::too_large;
                bool head = used.error().message().find("header") != std::string::npos;
                note("a request is refused: " + used.error().message(), peer);
                auto text = text_of(make_answer(!big ? 400 : head ? 431 : 413, used.error().message() + "\n"), false);
                line.until(ise::saturating_add(loop_.now(), limits_.request_time));
                co_await line.write_all(text);
                line.line().shutdown_write();
                co_await line.drop_rest(most_dropped);
                co_return;
            }
            rest = rest.subspan(*used);
            if (!timed)
                line.until(
                    ise::saturating_add(loop_.now(), limits_.request_time)); // of the whole request, not of each byte
            timed = true;
            if (reader.wants_continue()) {
                auto unsent = co_await line.write_all("HTTP/1.1 100 Continue\r\n\r\n");
                if (unsent) co_return;
            }
        }
        webhook_request request;
        request.message = reader.take();
        request.peer = peer;
        bool keep = request.message.keep_alive && served + 1 < limits_.max_requests;
        ++requests_;
        line.until(ise::time_point::max());
        auto handling = answer_(std::move(request));
        auto answer = co_await std::move(handling);
        line.until(ise::saturating_add(loop_.now(), limits_.request_time));
        auto text = text_of(answer, keep);
        auto unsent = co_await line.write_all(text);
        if (unsent || !keep) co_return;
    }
}

void webhook_server::note(std::string_view what, const std::string& peer) {
    ++refused_;
    if (auto left_out = quiet_.admit(loop_.now()))
        log_.warning(what, {{"peer", peer}, {"left_out", std::to_string(*left_out)}});
}

} // namespace atirma
