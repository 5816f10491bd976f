#include <components/xbee/duty_cycle.hpp>

#include <algorithm>

namespace atirma::xbee {

void duty_cycle::add(instant now, instant airtime) {
    entries_.push_back({now, airtime});
    used_ += airtime;
}

instant duty_cycle::used(instant now) {
    while (!entries_.empty() && entries_.front().start + window <= now) {
        used_ -= entries_.front().airtime;
        entries_.pop_front();
    }
    return used_;
}

instant duty_cycle::available_at(instant now, instant airtime, bool hot) {
    if (airtime > budget || (hot && airtime > hot_budget)) return never;
    instant when = now, left = used(now);
    for (auto e = entries_.begin(); left + airtime > budget; ++e) {
        left -= e->airtime;
        when = std::max(when, e->start + window);
    }
    if (!hot) return when;
    instant recent{0};
    for (auto e = entries_.rbegin(); e != entries_.rend() && e->start + hot_window > when; ++e) {
        recent += e->airtime;
        // This one has to leave the second.
        if (recent + airtime > hot_budget) return std::max(when, e->start + hot_window);
    }
    return when;
}

} // namespace atirma::xbee
