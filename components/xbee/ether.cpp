#include <components/xbee/ether.hpp>

#include <algorithm>
#include <cmath>

namespace atirma::xbee {

void ether::attach(modem& m, place at) { nodes_.push_back({&m, at}); }

void ether::detach(modem& m) {
    std::erase_if(nodes_, [&](auto& n) { return n.device == &m; });
    std::erase_if(flights_, [&](auto& f) { return f.from == &m; });
}

void ether::move(const modem& m, place to) {
    for (auto& n : nodes_)
        if (n.device == &m) n.at = to;
}

double ether::strength_dbm(double power_dbm, double distance_m) const {
    return power_dbm - options_.reference_loss_db - 10 * options_.exponent * std::log10(std::max(distance_m, 1.0));
}

double ether::mean_dbm(const flight& f, place at) const {
    return strength_dbm(f.what.power_dbm, std::hypot(f.at.x_m - at.x_m, f.at.y_m - at.y_m));
}

instant ether::next_event() const noexcept {
    instant next = never;
    for (auto& n : nodes_) next = std::min(next, n.device->next_event());
    for (auto& f : flights_)
        if (!f.landed) next = std::min(next, f.what.end);
    return next;
}

void ether::advance(instant now) {
    collect();
    for (;;) {
        instant due = next_event();
        if (due == never || due > now) break;
        // Landings first: an acknowledgement that ends with its wait has arrived.
        for (std::size_t i = 0; i < flights_.size(); ++i)
            if (!flights_[i].landed && flights_[i].what.end <= due) land(i);
        for (auto& n : nodes_) n.device->advance(due);
        collect();
        std::erase_if(flights_, [&](auto& f) { return f.landed && f.what.end + std::chrono::milliseconds(200) < due; });
    }
}

void ether::collect() {
    for (auto& n : nodes_)
        for (auto& t : n.device->take_transmissions()) {
            flights_.push_back({std::move(t), n.device, n.at});
            auto& f = flights_.back();
            for (auto& other : nodes_)
                if (other.device != n.device && mean_dbm(f, other.at) > options_.sensitivity_dbm)
                    other.device->on_carrier(f.what.end);
        }
}

void ether::land(std::size_t index) {
    flights_[index].landed = true;
    flight f = flights_[index];
    for (auto& n : nodes_) {
        if (n.device == f.from) continue;
        double rssi = mean_dbm(f, n.at) + options_.shadowing_db * random_.normal();
        double out_of_reach = 1 / (1 + std::exp((rssi - options_.sensitivity_dbm) / 1.5));
        double draw = random_.uniform();
        bool deaf = false, collides = false;
        for (std::size_t i = 0; i < flights_.size(); ++i) {
            auto& other = flights_[i];
            if (i == index || other.what.start >= f.what.end || f.what.start >= other.what.end) continue;
            if (other.from == n.device) deaf = true;
            else if (mean_dbm(other, n.at) > rssi - options_.capture_db) collides = true;
        }
        if (deaf) {
            ++lost_;
        } else if (collides) {
            ++collided_;
            n.device->on_damaged(f.what.end);
        } else if (draw < out_of_reach) {
            ++lost_;
        } else if (draw < out_of_reach + (1 - out_of_reach) * options_.extra_loss) {
            ++lost_;
            n.device->on_damaged(f.what.end);
        } else {
            ++delivered_;
            n.device->on_air(f.what.end, f.what.packet, rssi);
        }
    }
}

} // namespace atirma::xbee
