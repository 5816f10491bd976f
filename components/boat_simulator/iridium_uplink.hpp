#pragma once
#include <components/boat/telemetry.hpp>
#include <components/boat_simulator/simulated_boat.hpp>
#include <components/iridium/sbd_port.hpp>

#include <ise/core/log.hpp>

#include <deque>
#include <functional>
#include <optional>

namespace atirma {

struct iridium_uplink_options {
    iridium::sbd_port_options port;                        ///< of the boat's 9602; an empty device: it has none
    double period_s = 600;                                 ///< of its telemetry, until a telecommand changes it
    ise::duration check_period = std::chrono::minutes(30); ///< after this time without a session it checks its mailbox
};

/// The boat's side of Iridium: sends its packets, the newest first and as many as one message holds, and passes
/// received telecommands on. Acknowledgements have precedence over telemetry and are kept until they are delivered;
/// telemetry older than that sent is discarded. Used on the boat's loop; outlives `run()`.
class iridium_uplink {
public:
    /// `sail` advances the boat's time before it receives a packet.
    iridium_uplink(ise::loop& on, ise::logger log, iridium_uplink_options options, std::function<void()> sail);

    /// Of the packets that it sends; empty: they are sent as they are.
    std::function<ise::bytes(ise::bytes)> seal;
    /// Of the packets that it receives: nothing where one is refused. Empty: they are taken as they are.
    std::function<std::optional<ise::bytes>(ise::bytes_view)> open;

    ise::task<> run(simulator::simulated_boat& boat);
    /// A notice about the seal, sealed.
    void put_sealed(ise::bytes raw);
    /// Takes the boat's packets for this link; called after each step of the boat.
    void carry();
    link_status status() const;
    std::uint64_t telecommands_heard() const noexcept { return heard_; }

private:
    void on_event(const iridium::sbd_event& event);
    void send();

    static constexpr std::size_t max_acknowledgements = 32, max_telemetry = 32;

    ise::loop& loop_;
    ise::logger log_;
    iridium_uplink_options options_;
    std::function<void()> sail_;
    iridium::sbd_port port_;
    simulator::simulated_boat* boat_ = nullptr;
    std::deque<ise::bytes> acknowledgements_, telemetry_; // oldest first
    std::size_t acknowledgements_in_hand_ = 0;            // the first of them are in the message in transit
    ise::time_point last_session_{};
    std::uint64_t sent_ = 0, failed_ = 0, heard_ = 0;
};

} // namespace atirma
