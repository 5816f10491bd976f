#pragma once
#include <components/boat_simulator/simulated_boat.hpp>
#include <components/iridium/sbd_port.hpp>

#include <ise/core/log.hpp>

#include <deque>
#include <vector>

namespace atirma {

/// The second controller's own 9602: its packets, the newest first and as many as one message holds, kept until
/// a message took them. Nothing is received over it. Used on the boat's loop; outlives `run()`.
class beacon_uplink {
public:
    beacon_uplink(ise::loop& on, ise::logger log, iridium::sbd_port_options options);

    /// Serves the modem until it is cancelled; never fails.
    ise::task<> run() { return port_.run(); }
    /// Takes the packets; called after each step of the boat.
    void carry(simulator::second_controller& from);
    std::uint64_t sent() const noexcept { return sent_; } ///< messages at the gateway

private:
    void on_event(const iridium::sbd_event& event);

    static constexpr std::size_t max_waiting = 8;

    ise::logger log_;
    iridium::sbd_port port_;
    std::deque<ise::bytes> waiting_;  // newest first
    std::vector<ise::bytes> in_hand_; // of the message on its way
    std::uint64_t sent_ = 0;
};

} // namespace atirma
