#pragma once
#include <components/gprs_link/carrier_air.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>

#include <chrono>
#include <functional>
#include <list>
#include <map>
#include <memory>

namespace atirma {

/// Carries datagrams: for each address that the boat sends from there is one that the proxy sees, and that can change.
/// What goes through is delayed, may be lost, and overtakes. Used on one loop; must outlive the coroutines that it
/// spawns.
class datagram_relay {
public:
    static constexpr std::size_t max_flows = 64; ///< beyond, the one that was idle longest goes
    static constexpr std::size_t max_held = 512; ///< datagrams under way of one flow; beyond: lost
    /// Without a datagram either way; then the flow ends.
    static constexpr ise::duration max_idle = std::chrono::minutes(5);

    datagram_relay(ise::loop& on, ise::logger log, carrier_air& air, ise::endpoint proxy,
                   std::function<void(std::string, ise::task<>)> spawn)
        : loop_(on), log_(std::move(log)), air_(air), proxy_(std::move(proxy)), spawn_(std::move(spawn)) {}

    ise::result<ise::endpoint> open(const ise::endpoint& at);
    /// The flows of now come from other ports.
    void change_addresses();
    /// The flows of now carry nothing any more; the boat's next address does.
    void freeze_all();
    std::size_t flows() const noexcept { return flows_.size(); }
    std::size_t frozen() const;

private:
    struct flow {
        explicit flow(datagram_relay& self) : due(self.loop_, [this, &self] { self.turn(*this); }) {}
        std::shared_ptr<ise::datagram_socket> channel; // that the boat knows
        ise::endpoint boat;
        std::shared_ptr<ise::datagram_socket> out;                             // that the proxy knows
        std::multimap<ise::time_point, std::pair<bool, ise::bytes>> under_way; // by arrival; up or not
        ise::timer due;
        ise::time_point used{}; // when a datagram came, either way
        bool frozen = false, over = false;
    };

    ise::task<> from_boats(std::shared_ptr<ise::datagram_socket> channel);
    ise::task<> from_proxy(std::shared_ptr<flow> of, std::shared_ptr<ise::datagram_socket> out);
    std::shared_ptr<flow> flow_of(const std::shared_ptr<ise::datagram_socket>& channel, const ise::endpoint& boat);
    bool connect(const std::shared_ptr<flow>& of);
    void send(flow& of, bool upward, ise::bytes content);
    void turn(flow& of);
    void end(const flow& of);

    ise::loop& loop_;
    ise::logger log_;
    carrier_air& air_;
    ise::endpoint proxy_;
    std::function<void(std::string, ise::task<>)> spawn_;
    std::list<std::shared_ptr<flow>> flows_; // the one that was used last is first
};

} // namespace atirma
