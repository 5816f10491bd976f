#include <components/nmea_bridge/line_outlet.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <algorithm>
#include <array>

namespace atirma {

struct line_outlet::client {
    client(ise::loop& on, ise::net::admitted of) : stream(std::move(of.line)), wake(on), place(std::move(of.place)) {
        place->serve(); // a client is given lines and need not say anything
        place->on_displaced([this] { close(); });
    }

    void close() {
        if (std::exchange(closed, true)) return;
        stream->close();
        wake.resume({});
    }

    std::unique_ptr<ise::stream> stream;
    ise::waiter<std::error_code> wake;
    std::string queue;
    bool closed = false;
    std::unique_ptr<ise::net::fair_places::place> place;
};

struct line_outlet::state {
    state(ise::component& of, outlet_options with) : owner(of), options(std::move(with)), places(options.max_clients) {}

    void add(client& to, std::string_view lines) {
        if (to.queue.size() + lines.size() > options.max_queued_bytes) {
            ++counts.dropped_slow;
            owner.log().warning("a client that does not read is disconnected", {{"peer", to.stream->peer()}});
            to.close();
            return;
        }
        to.queue.append(lines);
        to.wake.resume({});
    }

    ise::component& owner;
    outlet_options options;
    std::function<std::string()> greeting;
    std::shared_ptr<ise::listener> listener;
    ise::net::fair_places places; // before the clients, who hold them
    std::unique_ptr<ise::datagram_socket> socket;
    std::list<std::shared_ptr<client>> clients;
    outlet_status counts;
};

line_outlet::line_outlet(ise::component& owner, outlet_options options, std::function<std::string()> greeting)
    : state_(std::make_shared<state>(owner, std::move(options))) {
    state_->greeting = std::move(greeting);
    if (!state_->options.udp.empty()) {
        bool six = state_->options.udp.front().host.find(':') != std::string::npos;
        ise::endpoint any{ise::protocol::udp, six ? "::" : "0.0.0.0", 0, {}};
        state_->socket = owner.env().open_datagram(owner.on(), any).value();
    }
    if (state_->options.tcp) {
        state_->listener = owner.env().listen(owner.on(), *state_->options.tcp).value();
        state_->counts.listens = state_->listener->where().text();
        owner.spawn("clients",
                    ise::net::accept_each(owner.on(), state_->listener, &state_->places,
                                          ise::net::log_to(owner.on(), owner.log()),
                                          [self = state_](ise::net::admitted who) { take(self, std::move(who)); }));
    }
}

line_outlet::~line_outlet() {
    if (state_->listener) state_->listener->close();
    if (state_->socket) state_->socket->close();
    for (const auto& one : std::exchange(state_->clients, {})) one->close();
}

void line_outlet::send(const std::string& lines) {
    ++state_->counts.messages;
    for (const auto& to : state_->options.udp)
        if (state_->socket->try_send(to, ise::as_bytes(lines))) ++state_->counts.datagrams_failed;
    for (const auto& one : std::list(state_->clients)) state_->add(*one, lines);
}

outlet_status line_outlet::status() const {
    auto result = state_->counts;
    result.clients = static_cast<std::uint32_t>(state_->clients.size());
    return result;
}

void line_outlet::take(const std::shared_ptr<state>& self, ise::net::admitted who) {
    if (who.refused) {
        ++self->counts.refused;
        return;
    }
    ++self->counts.accepted;
    auto one = std::make_shared<client>(self->owner.on(), std::move(who));
    self->clients.push_back(one);
    self->add(*one, self->greeting());
    self->owner.spawn("client", write(self, one));
    self->owner.spawn("client's end", read(self, one));
}

ise::task<> line_outlet::write(std::shared_ptr<state> self, std::shared_ptr<client> whom) {
    auto to = std::move(whom); // its place goes before the places; the order of parameters differs among compilers
    struct leaving {
        state& from;
        const std::shared_ptr<client>& who;
        ~leaving() {
            who->close();
            from.clients.remove(who);
        }
    } guard{*self, to};
    while (!to->closed) {
        if (to->queue.empty()) {
            co_await to->wake.wait(); // throws what it was resumed with
            continue;
        }
        asio::const_buffer whole = asio::buffer(to->queue);
        auto moved = to->stream->try_write({&whole, 1});
        to->queue.erase(0, moved.bytes);
        if (!moved.problem) continue;
        if (moved.problem != asio::error::would_block) co_return;
        auto problem = co_await to->stream->wait_writable();
        if (problem) co_return;
    }
}

ise::task<> line_outlet::read(std::shared_ptr<state> self, std::shared_ptr<client> whom) {
    auto keep = std::move(self);
    auto from = std::move(whom);
    std::array<char, 512> ignored;
    while (!from->closed) {
        auto got = co_await from->stream->read_some(asio::buffer(ignored));
        if (got.problem) from->close();
    }
}

} // namespace atirma
