#include <components/http/webhook_server.hpp>

#include <components/http/http_requests.hpp>
#include <components/http/line_with_deadline.hpp>

#include <asio/cancellation_type.hpp>
#include <asio/this_coro.hpp>
#include <fmt/format.h>

namespace atirma {
namespace {

constexpr std::size_t max_turned_away = 32;  // at a time; beyond it they are just closed
constexpr std::size_t max_dropped = 1 << 20; // bytes of a request that was refused

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
    : loop_(on), log_(std::move(log)), limits_(limits), answer_(std::move(answer)), spawn_(std::move(spawn)),
      places_(limits.max_connections) {}

ise::result<void> webhook_server::listen(const ise::endpoint& at) {
    auto made = loop_.env().listen(loop_, at);
    if (!made) return made.error();
    listener_ = std::move(*made);
    return {};
}

ise::task<> webhook_server::run() {
    ise::net::bounded_acceptor entrance(loop_, listener_, &places_,
                                        [this](const std::string& what, const std::string& at) { note(what, at); });
    for (;;) {
        auto who = co_await entrance.next();
        if (!who.line) co_return;
        auto peer = who.line->peer();
        if (!who.refused) {
            spawn_("http " + peer, serve(std::move(who)));
            continue;
        }
        note(fmt::format("{} connections are open: another one is turned away", places_.taken()), peer);
        if (turned_away_ < max_turned_away) spawn_("http " + peer, turn_away(std::move(who.line)));
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
ise::task<> webhook_server::serve(ise::net::admitted who) {
    auto peer = who.line->peer();
    std::string problem;
    try {
        co_await converse(peer, std::move(who));
    } catch (const std::exception& why) {
        problem = why.what();
    }
    auto state = co_await asio::this_coro::cancellation_state;
    if (!problem.empty() && state.cancelled() == asio::cancellation_type::none)
        note("a connection ended: " + problem, peer);
}

ise::task<> webhook_server::converse(std::string peer, ise::net::admitted who) {
    http_requests requests(loop_, std::move(who.line), limits_.message, limits_.times);
    auto& line = requests.line();
    for (std::size_t served = 1;; ++served) {
        auto message = co_await requests.next();
        if (!message) {
            const auto& refused = requests.refused();
            if (who.place->displaced())
                note(fmt::format("{} connections are open (max_connections): the oldest idle one of the host with the "
                                 "most was closed",
                                 places_.most()),
                     peer);
            else if (refused) note("a request is refused: " + refused->why, peer);
            if (!refused || refused->status == 0) co_return;
            auto text = text_of(make_answer(refused->status, refused->why + "\n"), false);
            line.until(ise::saturating_add(loop_.now(), limits_.times.request));
            co_await line.write_all(text);
            line.line().shutdown_write();
            co_await line.drop_rest(max_dropped);
            co_return;
        }
        who.place->serve();
        webhook_request request;
        request.message = std::move(*message);
        request.peer = peer;
        bool keep = request.message.keep_alive && served < limits_.max_requests;
        ++requests_;
        line.until(ise::time_point::max());
        auto handling = answer_(std::move(request));
        auto answer = co_await std::move(handling);
        line.until(ise::saturating_add(loop_.now(), limits_.times.request));
        auto text = text_of(answer, keep);
        auto unsent = co_await line.write_all(text);
        if (unsent || !keep) co_return;
        who.place->wait();
    }
}

void webhook_server::note(std::string_view what, const std::string& peer) {
    ++refused_;
    if (auto left_out = quiet_.admit(loop_.now()))
        log_.warning(what, {{"peer", peer}, {"left_out", std::to_string(*left_out)}});
}

} // namespace atirma
