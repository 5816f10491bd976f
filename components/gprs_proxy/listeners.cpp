#include <components/gprs_proxy/listeners.hpp>

#include <ise/core/sleep.hpp>
#include <ise/net/bounded_acceptor.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/format.h>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration write_pause = 50ms;
constexpr ise::duration receive_pause = 250ms;
} // namespace

ise::result<ise::endpoint> listeners::open(const ise::endpoint& at) {
    if (at.kind == ise::protocol::tcp || at.kind == ise::protocol::tls) {
        auto made =
            at.kind == ise::protocol::tls ? at.kind->listen(loop_, at, security_) : loop_.env().listen(loop_, at);
        if (!made) return made.error();
        std::shared_ptr<ise::listener> listener = std::move(*made);
        auto where = listener->where();
        spawn_("boats at " + where.text(), // the shore bounds the connections: it knows who has logged in
               ise::net::accept_each(loop_, std::move(listener), nullptr, ise::net::log_to(loop_, log_),
                                     [this](ise::net::admitted who) { take(std::move(who.line)); }));
        return where;
    }
    if (at.kind == ise::protocol::udp) {
        auto made = loop_.env().open_datagram(loop_, at);
        if (!made) return made.error();
        std::shared_ptr<ise::datagram_socket> socket = std::move(*made);
        auto where = socket->where();
        auto channel = ++last_channel_;
        sockets_[channel] = socket;
        spawn_("boats at " + where.text(), receive(channel, std::move(socket)));
        return where;
    }
    return ise::failure(
        ise::errc::invalid_argument,
        fmt::format("a boat calls over tcp, tls or udp, not {}: such as tcp://0.0.0.0:7420", at.text()));
}

void listeners::take(std::unique_ptr<ise::stream> boat) {
    auto made = std::make_shared<line>();
    made->stream = std::move(boat);
    gprs::way by;
    by.channel = ++last_channel_;
    auto peer = ise::endpoint::parse(made->stream->peer());
    if (peer) by.peer = *peer;
    lines_[by.channel] = made;
    on_connected(by);
    spawn_("boat's connection", read(by.channel, std::move(made)));
}

ise::task<> listeners::read(std::uint64_t channel, std::shared_ptr<line> from) {
    struct forget {
        listeners* self;
        std::uint64_t channel;
        ~forget() { self->lines_.erase(channel); }
    } guard{this, channel};
    std::array<std::byte, 1024> buffer;
    auto peer = from->stream->peer();
    bool verified = !peer.starts_with("tls://"); // by the first byte it is
    for (;;) {
        if (from->cut) co_return;
        auto got = co_await from->stream->read_some(asio::buffer(buffer));
        if (from->cut) co_return;
        verified = verified || got.bytes > 0;
        if (got.bytes > 0) on_bytes(channel, ise::bytes_view(buffer).first(got.bytes));
        if (!got.problem) continue;
        if (got.problem == asio::error::operation_aborted) co_return;
        if (!verified && got.problem != asio::error::eof && on_unverified) {
            auto verdict = from->stream->verdict();
            on_unverified(peer, verdict ? verdict->message() : got.problem.message());
        }
        if (!from->cut)
            on_disconnected(channel, got.problem == asio::error::eof
                                         ? "the boat closed the connection"
                                         : "the connection broke: " + got.problem.message());
        co_return;
    }
}

ise::task<> listeners::receive(std::uint64_t channel, std::shared_ptr<ise::datagram_socket> at) {
    for (;;) {
        auto [problem, got] = co_await at->receive();
        if (problem == asio::error::operation_aborted) co_return;
        if (problem) {
            log_.warning("the socket for datagrams failed", {{"cause", problem.message()}, {"at", at->where().text()}});
            co_await ise::sleep_for(loop_, receive_pause);
            continue;
        }
        gprs::way by;
        by.channel = channel;
        by.peer = got->peer;
        by.datagrams = true;
        const bool too_large = got->content.size() > largest_datagram; // told as one that makes no sense
        on_datagram(by, too_large ? ise::bytes_view() : got->content);
    }
}

void listeners::send(const gprs::way& to, std::string_view text) {
    if (to.datagrams) {
        auto found = sockets_.find(to.channel);
        if (found == sockets_.end()) return;
        auto problem = found->second->try_send(to.peer, ise::as_bytes(text)); // what is lost is asked for again
        if (problem && problem != asio::error::would_block)
            log_.debug("a datagram was not sent", {{"to", to.peer.text()}, {"cause", problem.message()}});
        return;
    }
    auto found = lines_.find(to.channel);
    if (found == lines_.end() || found->second->cut) return;
    auto& over = *found->second;
    // Acknowledgements are cumulative, telecommands come again.
    if (over.unwritten.size() + text.size() > most_unwritten) return;
    over.unwritten.add(text);
    if (over.unwritten.write(*over.stream)) over.unwritten.clear(); // the reader learns it, too
    if (over.unwritten.size() > 0 && !again_.armed()) again_.arm(ise::saturating_add(loop_.now(), write_pause));
}

void listeners::write_again() {
    bool more = false;
    for (auto& [channel, one] : lines_) {
        if (one->cut) continue;
        if (one->unwritten.write(*one->stream)) one->unwritten.clear();
        more = more || one->unwritten.size() > 0;
    }
    if (more) again_.arm(ise::saturating_add(loop_.now(), write_pause));
}

void listeners::cut(std::uint64_t channel) {
    auto found = lines_.find(channel);
    if (found == lines_.end()) return;
    found->second->cut = true;
    found->second->stream->close(); // its reader ends
}

} // namespace atirma
