#include <ise/sim/tcp_connection.hpp>

#include <asio/error.hpp>

#include <ranges>

namespace ise::sim {
namespace {

class tcp_end final : public stream_end {
public:
    tcp_end(std::shared_ptr<tcp_connection> connection, std::size_t side, socket_owner& owner, loop& on,
            std::size_t limit, std::string peer, std::optional<endpoint> local)
        : stream_end(owner, on, limit, std::move(peer), std::move(local)), connection_(std::move(connection)),
          side_(side) {}

    void limit_unsent(std::size_t most) override { connection_->limit_unsent(side_, most); }

private:
    std::size_t send_room() const override { return connection_->room(side_); }
    void send(bytes_view content) override { connection_->send(side_, content); }
    void finish() override { connection_->finish(side_); }
    void drained() override { connection_->drained(side_); }
    void let_go() override { // as a kernel does: a reset when something was left unread
        if (unread()) connection_->reset_from(side_);
        else connection_->finish(side_);
        connection_->drained(side_);
    }
    void lost(ending how) override {
        switch (how) {
            case ending::stop: let_go(); break;
            case ending::crash: connection_->reset_from(side_); break;
            case ending::host_lost: connection_->silence(side_); break;
        }
    }

    std::shared_ptr<tcp_connection> connection_;
    std::size_t side_;
};

// Big writes go in pieces, so that a slow link brings them bit by bit.
constexpr std::size_t max_piece = 16 * 1024;
constexpr std::size_t min_piece = 256;

std::size_t piece_on(const link& over) {
    if (over.bandwidth_bytes_per_second == 0) return max_piece;
    return std::clamp<std::size_t>(static_cast<std::size_t>(over.bandwidth_bytes_per_second / 50), min_piece,
                                   max_piece);
}

} // namespace

tcp_connection::tcp_connection(network& net, machine& client, machine& server, std::string client_name,
                               std::string server_name)
    : net_(net), over_(net.between(client.name(), server.name())) {
    halves_[0].from = halves_[1].to = &client;
    halves_[1].from = halves_[0].to = &server;
    halves_[0].name = client_name + "->" + server_name;
    halves_[1].name = server_name + "->" + client_name;
    halves_[0].upward = client.name() <= server.name();
    halves_[1].upward = !halves_[0].upward;
    if (auto rule = net.take_cut(client, server))
        halves_[rule->which == direction::to_server ? 0 : 1].cut_at = rule->after_bytes;
}

std::unique_ptr<stream> tcp_connection::open_side(std::size_t side, socket_owner& owner, loop& on, std::string peer,
                                                  std::optional<endpoint> local) {
    auto end = std::make_shared<tcp_end>(shared_from_this(), side, owner, on, over_.receive_buffer_bytes,
                                         std::move(peer), std::move(local));
    ends_[side] = end;
    owner.attach(end);
    return make_stream(std::move(end));
}

std::size_t tcp_connection::room(std::size_t side) const {
    const auto& from = halves_[side];
    auto left = [](std::size_t limit, std::size_t used) { return used >= limit ? 0 : limit - used; };
    return std::min(left(over_.send_buffer_bytes, from.unarrived), left(from.unsent_limit, unsent(side)));
}

std::size_t tcp_connection::unsent(std::size_t side) const {
    const auto now = net_.world().now();
    const auto& from = halves_[side];
    std::size_t waiting = 0;
    for (const auto& each : from.under_way | std::views::reverse) {
        if (each.departs <= now && !from.window_shut) break; // what the receiver has no room for was not sent either
        waiting += each.content.size() - each.taken;
    }
    return waiting;
}

void tcp_connection::send(std::size_t side, bytes_view content) {
    const auto piece = piece_on(over_);
    while (!content.empty()) {
        const auto part = content.first(std::min(piece, content.size()));
        put(side, kind::data, bytes(part.begin(), part.end()));
        content = content.subspan(part.size());
    }
}

void tcp_connection::finish(std::size_t side) { put(side, kind::finish, {}); }

void tcp_connection::reset_from(std::size_t side) {
    drop_from(side, false);
    put(side, kind::reset, {});
    auto& back = halves_[1 - side]; // nobody there takes what still comes
    back.under_way.clear();
    back.unarrived = 0;
}

void tcp_connection::silence(std::size_t side) {
    drop_from(side, halves_[side].held);
    halves_[side].silent = true;
}

// What has not left yet; what stalled would have to be sent again.
void tcp_connection::drop_from(std::size_t side, bool all) {
    auto& from = halves_[side];
    const auto now = net_.world().now();
    while (!from.under_way.empty() && (all || from.under_way.back().departs > now)) {
        from.unarrived -= from.under_way.back().content.size() - from.under_way.back().taken;
        from.under_way.pop_back();
    }
}

void tcp_connection::put(std::size_t side, kind what, bytes content) {
    auto& from = halves_[side];
    if (over_and_done_ || from.silent) return;
    auto flight = net_.send(over_, from.upward, content.size());
    if (what == kind::data) { // sent again until it is through
        auto again = net_.retransmission;
        for (int tries = 0; tries < 8 && over_.random_loss(); ++tries, again *= 2) flight.arrives += again;
    }
    from.last_arrival = std::max(from.last_arrival, flight.arrives);
    from.unarrived += content.size();
    from.under_way.push_back({what, flight.departs, from.last_arrival, std::move(content), 0});
    schedule(side);
}

void tcp_connection::schedule(std::size_t side) {
    auto& from = halves_[side];
    if (from.scheduled || from.held || from.under_way.empty()) return;
    from.scheduled = true;
    net_.world().engine().at(from.under_way.front().arrives, nullptr, [self = shared_from_this(), side] {
        self->halves_[side].scheduled = false;
        self->deliver(side);
    });
}

void tcp_connection::hold(std::size_t side) {
    auto& from = halves_[side];
    if (from.silent) { // nobody left to send it again
        drop_from(side, true);
        return;
    }
    if (std::exchange(from.held, true)) return;
    net_.world().note("stall", from.name, from.unarrived);
    net_.hold_until_heal(weak_from_this(), [self = shared_from_this(), side] {
        auto& again = self->halves_[side];
        again.held = false;
        for (auto& each : again.under_way)
            each.arrives = std::max(each.arrives, self->net_.world().now() + self->over_.latency);
        if (!again.under_way.empty()) again.last_arrival = std::max(again.last_arrival, again.under_way.back().arrives);
        self->schedule(side);
    });
}

void tcp_connection::deliver(std::size_t side) {
    auto& from = halves_[side];
    auto& world = net_.world();
    while (!from.under_way.empty() && from.under_way.front().arrives <= world.now()) {
        if (!net_.passes(*from.from, *from.to)) return hold(side);
        auto& first = from.under_way.front();
        auto target = ends_[1 - side].lock();
        if (first.what == kind::reset) {
            world.note("reset", from.name);
            from.under_way.clear();
            over_and_done_ = true;
            if (target) target->fail(asio::error::connection_reset);
            return;
        }
        if (!target || target->gone()) {
            if (first.what == kind::data) { // its kernel knows of no such connection
                from.under_way.clear();
                from.unarrived = 0;
                halves_[1 - side].silent = false; // a host that is up again answers
                put(1 - side, kind::reset, {});
                return;
            }
            from.under_way.pop_front();
            continue;
        }
        if (first.what == kind::finish) {
            world.note("end", from.name);
            from.under_way.pop_front();
            target->receive_end();
            continue;
        }
        if (!deliver_data(side, first)) return;
    }
    schedule(side);
}

// False when nothing more can be delivered now.
bool tcp_connection::deliver_data(std::size_t side, segment& first) {
    auto& from = halves_[side];
    auto target = ends_[1 - side].lock();
    auto source = ends_[side].lock();
    auto left = bytes_view(first.content).subspan(first.taken);
    if (from.cut_at) {
        const auto before_cut = std::min<std::uint64_t>(left.size(), *from.cut_at - from.delivered);
        left = left.first(static_cast<std::size_t>(before_cut));
    }
    const auto count = target->receive(left);
    if (count > 0) {
        net_.world().note("deliver", from.name, count);
        first.taken += count;
        from.unarrived -= count;
        from.delivered += count;
        net_.count_delivered(way(side), count);
    }
    if (from.cut_at && from.delivered >= *from.cut_at) {
        cut_now();
        return false;
    }
    if (first.taken < first.content.size()) {
        // A reset gets through where data do not.
        if (from.under_way.back().what == kind::reset) {
            from.unarrived = 0;
            from.under_way.erase(from.under_way.begin(), std::prev(from.under_way.end()));
            schedule(side);
        } else {
            from.window_shut = true;
        }
        return false;
    }
    from.under_way.pop_front();
    if (source && from.unarrived <= over_.send_buffer_bytes / 2 && unsent(side) < from.unsent_limit)
        source->wake_writer();
    return true;
}

void tcp_connection::drained(std::size_t side) {
    auto& towards = halves_[1 - side];
    if (!towards.window_shut) return;
    towards.window_shut = false;
    schedule(1 - side);
}

void tcp_connection::cut_now() {
    over_and_done_ = true;
    net_.count_cut();
    net_.world().note("cut", halves_[0].name);
    for (auto& each : halves_) {
        each.under_way.clear();
        each.unarrived = 0;
    }
    for (auto& end : ends_)
        if (auto there = end.lock()) there->fail(asio::error::connection_reset);
}

} // namespace ise::sim
