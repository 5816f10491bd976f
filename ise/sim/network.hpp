#pragma once
#include <ise/sim/link.hpp>
#include <ise/sim/machine.hpp>
#include <ise/sim/world_core.hpp>

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ise::sim {

/// A direction of a connection.
enum class direction { to_server, to_client };

/// The network between the hosts of a world, and its faults.
class network {
public:
    /// Made by the world.
    explicit network(world_core& world) : world_(world) {}

    /// The link between two hosts, or within one (`between("boat", "boat")`).
    link& between(const std::string& a, const std::string& b);

    /// Partitions two hosts without notifying them: streams stall, datagrams are lost, connects time out.
    void partition(const std::string& a, const std::string& b);
    /// Ends a partition; stalled streams continue.
    void heal(const std::string& a, const std::string& b);
    /// Partitions a host from all others.
    void isolate(const std::string& host);
    /// Ends every partition.
    void heal_all();

    /// The next connection from `client` to `server` is cut when this many bytes have gone `which` way: both
    /// sides see connection_reset after exactly these bytes. 0: immediately.
    void cut(const std::string& client, const std::string& server, direction which, std::uint64_t after_bytes);
    /// How many were cut so far: a sweep is over when a run adds none.
    std::uint64_t cuts() const noexcept { return cuts_; }
    /// Bytes that have gone each way, of all streams so far: how far a sweep has to go.
    std::uint64_t delivered(direction which) const noexcept { return delivered_[which == direction::to_client]; }

    duration connect_timeout = std::chrono::seconds(10);      ///< of an unanswered connect
    duration connect_retry = std::chrono::seconds(1);         ///< of a lost connect
    duration retransmission = std::chrono::milliseconds(200); ///< of a stream's lost packet, doubling

    /// @cond
    // For the world's parts.
    struct cut_rule {
        std::string client, server;
        direction which;
        std::uint64_t after_bytes;
    };
    world_core& world() noexcept { return world_; }
    void join(machine& host) { hosts_[host.name()] = &host; }
    machine* find(const std::string& name_or_address) const;
    bool passes(const machine& from, const machine& to);
    /// When a packet sent now arrives, by the link's bandwidth, latency and jitter.
    struct flight {
        time_point departs, arrives;
    };
    flight send(link& over, bool upward, std::size_t size);
    duration queue(const link& over, bool upward) const; ///< how long what is sent now waits for bandwidth
    void look_again();                                   ///< what stalled tries once more
    void hold_until_heal(std::weak_ptr<void> life, std::function<void()> go_on);
    std::optional<cut_rule> take_cut(const machine& client, const machine& server);
    void count_cut() noexcept { ++cuts_; }
    void count_delivered(direction which, std::uint64_t bytes) noexcept {
        delivered_[which == direction::to_client] += bytes;
    }
    /// @endcond

private:
    struct held {
        std::weak_ptr<void> life;
        std::function<void()> go_on;
    };

    world_core& world_;
    std::map<std::string, machine*> hosts_;
    std::map<std::pair<std::string, std::string>, std::unique_ptr<link>> links_; // names in order
    std::vector<held> held_;
    std::vector<cut_rule> cuts_to_come_;
    std::uint64_t cuts_ = 0;
    std::array<std::uint64_t, 2> delivered_{};
};

} // namespace ise::sim
