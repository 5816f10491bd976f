#include <components/iridium/directip_exchange.hpp>

#include <components/iridium/directip.hpp>
#include <ise/http/line_with_deadline.hpp>

#include <ise/net/connect.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/format.h>

#include <array>
#include <limits>

namespace atirma::iridium {
namespace {

/// One whole message, never more than it says it is.
ise::task<ise::result<ise::bytes>> read_message(ise::line_with_deadline& from) {
    ise::bytes whole;
    std::array<std::byte, 2048> buffer;
    for (;;) {
        auto length = directip_length(whole);
        if (!length) co_return length.error();
        std::size_t wanted = *length ? **length : directip_prefix;
        if (*length && whole.size() == wanted) co_return whole;
        auto got = co_await from.read_some(asio::buffer(buffer.data(), std::min(wanted - whole.size(), buffer.size())));
        whole.insert(whole.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(got.bytes));
        if (got.bytes > 0) continue;
        if (got.problem == asio::error::timed_out)
            co_return ise::failure(ise::errc::timed_out, "no whole message in time", ise::execution::unknown);
        auto why = whole.empty() ? std::string("closed without a message")
                                 : fmt::format("cut off after {} of {} bytes", whole.size(), wanted);
        co_return ise::failure(ise::errc::peer_lost, why, ise::execution::unknown);
    }
}

} // namespace

ise::task<ise::result<ise::bytes>> ask_directip(ise::loop& on, ise::endpoint to, ise::bytes message,
                                                ise::duration within) {
    auto deadline = ise::saturating_add(on.now(), within);
    auto where = to.text();
    auto connected = co_await ise::net::connect_until(on, std::move(to), deadline);
    if (!connected) co_return ise::failure(ise::errc::unreachable, connected.error().message());
    ise::line_with_deadline line(on, std::move(*connected));
    line.until(deadline);
    auto unsent = co_await line.write_all(ise::as_text(message));
    if (unsent)
        co_return ise::failure(unsent == asio::error::timed_out ? ise::errc::timed_out : ise::errc::peer_lost,
                               where + ": " + unsent.message(), ise::execution::unknown);
    auto answer = co_await read_message(line);
    if (!answer)
        co_return ise::failure(answer.error().code(), where + ": " + answer.error().message(), ise::execution::unknown);
    co_return std::move(*answer);
}

directip_server::directip_server(ise::loop& on, ise::logger log, directip_limits limits, handler answer, spawner spawn)
    : loop_(on), log_(std::move(log)), limits_(std::move(limits)), answer_(std::move(answer)), spawn_(std::move(spawn)),
      places_(limits_.max_connections) {}

ise::result<void> directip_server::listen(const ise::endpoint& at) {
    auto made = loop_.env().listen(loop_, at);
    if (!made) return made.error();
    listener_ = std::move(*made);
    spawn_("DirectIP", ise::net::accept_each(loop_, listener_, &places_, ise::net::log_to(loop_, log_),
                                             [this](ise::net::admitted who) { take(std::move(who)); }));
    return {};
}

void directip_server::take(ise::net::admitted who) {
    auto peer = who.line->peer();
    if (who.refused)
        note(fmt::format("{} connections are open (max_connections): another one is closed", places_.taken()), peer);
    else if (!limits_.allowed.accepts(peer))
        note("a connection is closed: its address is not on the list (--gateway-addresses)", peer);
    else spawn_("directip " + peer, serve(std::move(who)));
}

ise::task<> directip_server::serve(ise::net::admitted who) {
    auto peer = who.line->peer();
    ise::line_with_deadline line(loop_, std::move(who.line));
    line.until(ise::saturating_add(loop_.now(), limits_.message_time));
    auto message = co_await read_message(line);
    if (!message) {
        note(who.place->displaced()
                 ? std::string("no DirectIP message had come when its place was needed (max_connections)")
                 : "no DirectIP message came: " + message.error().message(),
             peer);
        co_return;
    }
    who.place->serve();
    auto answer = answer_(*message, peer);
    if (answer.empty()) co_return;
    line.until(ise::saturating_add(loop_.now(), limits_.message_time));
    auto unsent = co_await line.write_all(ise::as_text(answer));
    if (unsent) note("the confirmation could not be sent: " + unsent.message(), peer);
    line.line().shutdown_write();
    // The other side reads it and closes, or the time is over.
    co_await line.drop_rest(std::numeric_limits<std::size_t>::max());
}

void directip_server::note(std::string_view what, const std::string& peer) {
    if (auto left_out = quiet_.admit(loop_.now()))
        log_.warning(what, {{"peer", peer}, {"left_out", std::to_string(*left_out)}});
}

} // namespace atirma::iridium
