#pragma once
#include <components/boat/receipt.hpp>

#include <ise/core/time.hpp>

#include <deque>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace atirma::simulator {

/// Keeps telemetry until the shore has sent a receipt over the radio, and schedules the repetitions. Without I/O.
/// While the radio's acknowledgements show that the shore's modem hears the boat, packets are sent at once. Otherwise
/// they are held, and one is sent every few seconds as a probe: further retries would use up the duty cycle that the
/// backlog needs afterwards. Sent packets are repeated only to a shore that sends receipts.
class radio_backlog {
public:
    static constexpr std::size_t capacity = 8192; ///< packets; beyond that the oldest is discarded. Two hours
    static constexpr ise::duration alive_for = std::chrono::seconds(30), probe_period = std::chrono::seconds(15);
    static constexpr ise::duration first_pause = std::chrono::seconds(20), max_pause = std::chrono::minutes(5);
    /// Of the allowed duty cycle; above that, only new packets are sent.
    static constexpr unsigned max_duty_percent = 80;

    explicit radio_backlog(ise::time_point now) : heard_at_(now), receipted_at_(now) {}

    /// A packet that is not sent now: of a time without a modem, or without a receipt from before a restart.
    void put_held(ise::bytes raw);
    /// Adds a new packet. Returns whether to send it now; else it is held.
    bool put(ise::time_point now, const ise::bytes& raw);
    /// A packet that is due and that the duty cycle permits; empty bytes if there is none.
    ise::bytes next(ise::time_point now);
    /// The modem did not accept it.
    void not_taken(ise::bytes_view raw);

    void on_radio_acknowledgement(ise::time_point now) noexcept { heard_at_ = now; }
    /// Removes the packets of a receipt that had been sent: a forged receipt can prevent repetitions, never a first
    /// transmission.
    std::vector<packet_name> on_receipt(ise::time_point now, const telemetry_receipt& result);
    void on_duty(unsigned percent) noexcept { duty_percent_ = percent; }

    bool alive(ise::time_point now) const noexcept { return now - heard_at_ < alive_for; }
    std::size_t waiting() const noexcept { return kept_.size(); }
    std::uint64_t sent_again() const noexcept { return sent_again_; }
    std::uint64_t given_up() const noexcept { return given_up_; }
    /// The number of packets discarded since the last call.
    std::vector<packet_name> take_given_up() { return std::exchange(gone_, {}); }

private:
    struct kept_packet {
        ise::bytes raw;
        ise::time_point due{};
        ise::duration pause{0}; ///< until its repetition; 0: it was never sent, and is held
    };
    void sent(ise::time_point now, packet_name name, kept_packet& packet);
    void hold(packet_name name, kept_packet& packet);
    kept_packet& keep(packet_name name, ise::bytes raw);
    void forget(std::map<packet_name, kept_packet>::iterator which);

    std::map<packet_name, kept_packet> kept_;
    std::deque<packet_name> order_; ///< in the order of arrival; some may be removed already
    std::set<packet_name> held_;
    std::set<std::pair<ise::time_point, packet_name>> due_; ///< of those that were sent
    ise::time_point heard_at_, receipted_at_, probe_at_{};
    bool receipts_ = false;
    unsigned duty_percent_ = 0;
    std::uint64_t sent_again_ = 0, given_up_ = 0;
    std::vector<packet_name> gone_;
};

} // namespace atirma::simulator
