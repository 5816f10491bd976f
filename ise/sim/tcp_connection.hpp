#pragma once
#include <ise/sim/network.hpp>
#include <ise/sim/stream_end.hpp>

#include <array>
#include <deque>
#include <memory>

namespace ise::sim {

/// A connection between two hosts, or within one: what was sent and has not arrived, in both directions. Side 0
/// is the client, side 1 the server. Delivered in order, held back by the receiver's buffer, by the link and by
/// a partition. It goes on by itself for as long as something is under way.
class tcp_connection : public std::enable_shared_from_this<tcp_connection> {
public:
    tcp_connection(network& net, machine& client, machine& server, std::string client_name, std::string server_name);

    /// A stream on `on` at one of the sides; `local` of the one that was connected to.
    std::unique_ptr<stream> open_side(std::size_t side, socket_owner& owner, loop& on, std::string peer,
                                      std::optional<endpoint> local = std::nullopt);

    std::size_t room(std::size_t side) const;
    /// No room at that side while so many bytes wait there for the link's bandwidth.
    void limit_unsent(std::size_t side, std::size_t most) { halves_[side].unsent_limit = most; }
    void send(std::size_t side, bytes_view content);
    void finish(std::size_t side);
    /// `side` knows nothing of it any more: what has not left is lost and the other side is told so.
    void reset_from(std::size_t side);
    /// The host of that side is gone.
    void silence(std::size_t side);
    void drained(std::size_t side); ///< there is room again at that side
    /// When the first bytes of the server may arrive: after it is connected.
    void not_before(std::size_t side, time_point when) { halves_[side].last_arrival = when; }
    /// Cut as soon as it is made, if a fault says so.
    void cut_if_at_start() {
        if (halves_[0].cut_at == 0u || halves_[1].cut_at == 0u) cut_now();
    }

private:
    enum class kind { data, finish, reset };
    struct segment {
        kind what;
        time_point departs, arrives;
        bytes content;
        std::size_t taken = 0;
    };
    struct half { // from one side to the other
        machine* from = nullptr;
        machine* to = nullptr;
        bool upward = false;
        std::string name;
        std::deque<segment> under_way;
        std::size_t unarrived = 0;
        std::size_t unsent_limit = static_cast<std::size_t>(-1);
        std::uint64_t delivered = 0;
        std::optional<std::uint64_t> cut_at;
        time_point last_arrival{};
        bool scheduled = false;
        bool held = false;        // by a partition or a host that is down
        bool window_shut = false; // the receiver has no room
        bool silent = false;      // the sender's host is gone
    };

    void put(std::size_t side, kind what, bytes content);
    void drop_from(std::size_t side, bool all);
    std::size_t unsent(std::size_t side) const;
    void schedule(std::size_t side);
    void deliver(std::size_t side);
    bool deliver_data(std::size_t side, segment& first);
    void hold(std::size_t side);
    void cut_now();
    static direction way(std::size_t side) { return side == 0 ? direction::to_server : direction::to_client; }

    network& net_;
    link& over_;
    std::array<half, 2> halves_;
    std::array<std::weak_ptr<stream_end>, 2> ends_;
    bool over_and_done_ = false;
};

} // namespace ise::sim
