#pragma once
#include <components/boat/receipt.hpp>

#include <ise/core/time.hpp>

#include <deque>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace atirma::simulator {

/// The telemetry that a boat keeps until the shore has receipted it over the radio, and when each packet goes again.
/// Without I/O.
///
/// While the radio's acknowledgements show that the shore's modem hears the boat, packets go as they come. Otherwise
/// they are held, and one goes every few seconds to find the shore again: retries into the void would use up the duty
/// cycle that the backlog needs afterwards. What was sent is sent again only to a shore that gives receipts.
class radio_backlog {
public:
    static constexpr std::size_t capacity = 8192; ///< packets; beyond, the oldest is given up. Two hours
    static constexpr ise::duration alive_for = std::chrono::seconds(30), probe_period = std::chrono::seconds(15);
    static constexpr ise::duration first_pause = std::chrono::seconds(20), max_pause = std::chrono::minutes(5);
    static constexpr unsigned max_duty_percent = 80; ///< of what is allowed; above, only what is new is sent

    explicit radio_backlog(ise::time_point now) : heard_at_(now), receipted_at_(now) {}

    /// Of an earlier life, not receipted then.
    void restore(ise::bytes raw);
    /// A packet that is new. True: it is to be sent now; else it is held.
    bool put(ise::time_point now, const ise::bytes& raw);
    /// A packet that is due, and the duty cycle allows; empty bytes if there is none.
    ise::bytes next(ise::time_point now);
    /// The modem did not take it.
    void not_taken(ise::bytes_view raw);

    void on_radio_acknowledgement(ise::time_point now) noexcept { heard_at_ = now; }
    /// Those of the receipt that were kept here and had been sent: a forged one costs a packet its repetitions, never
    /// its first transmission.
    std::vector<packet_name> on_receipt(ise::time_point now, const telemetry_receipt& told);
    void on_duty(unsigned percent) noexcept { duty_percent_ = percent; }

    bool alive(ise::time_point now) const noexcept { return now - heard_at_ < alive_for; }
    std::size_t waiting() const noexcept { return kept_.size(); }
    std::uint64_t sent_again() const noexcept { return sent_again_; }
    std::uint64_t given_up() const noexcept { return given_up_; }
    /// Given up since it was asked last.
    std::vector<packet_name> take_given_up() { return std::exchange(gone_, {}); }

private:
    struct payload {
        ise::bytes raw;
        ise::time_point due{};
        ise::duration pause{0}; ///< after which it goes again; 0: it was never sent, and is held
    };
    void sent(ise::time_point now, packet_name name, payload& packet);
    void hold(packet_name name, payload& packet);
    payload& keep(packet_name name, ise::bytes raw);
    void forget(std::map<packet_name, payload>::iterator which);

    std::map<packet_name, payload> kept_;
    std::deque<packet_name> order_; ///< as they came; some are not kept any more
    std::set<packet_name> held_;
    std::set<std::pair<ise::time_point, packet_name>> due_; ///< of those that were sent
    ise::time_point heard_at_, receipted_at_, probe_at_{};
    bool receipts_ = false;
    unsigned duty_percent_ = 0;
    std::uint64_t sent_again_ = 0, given_up_ = 0;
    std::vector<packet_name> gone_;
};

} // namespace atirma::simulator
