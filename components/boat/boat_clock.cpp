#include <components/boat/boat_clock.hpp>

#include <algorithm>

namespace atirma {

ise::duration boat_clock::reading::ahead_at(ise::time_point now) const {
    return ahead - std::max(now - at, ise::duration()) / drift_parts;
}

const boat_clock::reading* boat_clock::find(std::uint16_t boot) const {
    auto found = std::ranges::find(readings_, boot, &reading::boot);
    return found == readings_.end() ? nullptr : &*found;
}

void boat_clock::heard(ise::time_point now, const packet_header& packet, bool current) {
    if (packet.boot == beacon_boot) return; // of the second controller, whose clock judges nothing
    auto measured = std::chrono::duration_cast<ise::duration>(packet.measured_at.time_since_epoch());
    auto ahead = measured - std::chrono::duration_cast<ise::duration>(now.time_since_epoch());
    auto known = std::ranges::find(readings_, packet.boot, &reading::boot);
    if (known == readings_.end()) {
        if (!current && !readings_.empty() && measured <= readings_.front().shown()) return;
        reading made;
        made.boot = packet.boot;
        made.ahead = ahead;
        made.at = now;
        readings_.push_front(made);
        if (readings_.size() > max_boots) readings_.pop_back();
        return;
    }
    if (ahead >= known->ahead_at(now)) {
        known->ahead = ahead;
        known->at = now;
    }
    if (current) std::rotate(readings_.begin(), known, known + 1);
}

void boat_clock::distrust(std::uint16_t boot) {
    for (auto& one : readings_)
        if (one.boot == boot) one.distrusted = true;
}

boat_clock::stamp boat_clock::read(ise::time_point now, utc_time wall) const {
    stamp made;
    made.at = wall;
    if (readings_.empty()) return made;
    const auto& present = readings_.front();
    auto shown = std::chrono::floor<std::chrono::milliseconds>(now.time_since_epoch() + present.ahead_at(now));
    made.at = utc_time(shown);
    if (present.distrusted || made.at > wall + max_ahead) made.boot = present.boot;
    return made;
}

utc_time boat_clock::shore_time(ise::time_point now, utc_time wall, const packet_header& packet) const {
    const auto* known = find(packet.boot);
    auto at = packet.measured_at;
    // A clock that GPS sets needs no help, and the way here is no error of the clock.
    if (known && (known->distrusted || at > wall + max_ahead))
        at = wall - (std::chrono::floor<std::chrono::milliseconds>(now.time_since_epoch() + known->ahead_at(now)) -
                     at.time_since_epoch());
    return std::min(at, wall);
}

} // namespace atirma
