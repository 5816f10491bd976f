#pragma once
#include <components/boat/random_source.hpp>
#include <components/xbee/modem.hpp>

namespace atirma::xbee {

/// Metres on a plane.
struct place {
    double x_m = 0;
    double y_m = 0;
};

struct ether_options {
    std::uint64_t seed = 1;
    double reference_loss_db = 31.2; ///< at one metre
    double exponent = 2.7;           ///< of the log-distance path loss
    double shadowing_db = 2;         ///< deviation from packet to packet
    double sensitivity_dbm = -112;   ///< half of the packets at this strength are lost
    double extra_loss = 0;           ///< part of the packets that is lost at any distance, 0 … 1
    double capture_db = 10;          ///< so much stronger survives a collision
};

/// The air that modems share: strength and loss by distance, collisions, a receiver deaf while it sends. The same seed,
/// places and inputs give the same. It drives the modems attached to it: after bytes were given to a modem, or when
/// `next_event` has come, call `advance`. A modem must outlive its attachment. Not thread safe.
class ether {
public:
    explicit ether(ether_options options = {}) : options_(options), random_(options.seed) {}

    void attach(modem& m, place at);
    void detach(modem& m);
    void move(const modem& m, place to);
    void set_extra_loss(double part) noexcept { options_.extra_loss = part; }

    void advance(instant now);
    instant next_event() const noexcept;

    /// Mean strength at a distance, without shadowing.
    double strength_dbm(double power_dbm, double distance_m) const;

    std::uint64_t delivered() const noexcept { return delivered_; } ///< receptions
    std::uint64_t lost() const noexcept { return lost_; }
    std::uint64_t collided() const noexcept { return collided_; }

private:
    struct node {
        modem* device;
        place at;
    };
    struct flight {
        transmission what;
        const modem* from;
        place at;
        bool landed = false;
    };
    void collect();
    void land(std::size_t index);
    double mean_dbm(const flight& f, place at) const;

    ether_options options_;
    random_source random_;
    std::vector<node> nodes_;
    std::vector<flight> flights_;
    std::uint64_t delivered_ = 0, lost_ = 0, collided_ = 0;
};

} // namespace atirma::xbee
