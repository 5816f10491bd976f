#include <components/boat_simulator/telemetry_schedule.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace atirma::simulator {
namespace {
// The number of periods between two packets of a type. Iridium costs by the byte: only position and navigation, unless
// others are requested.
constexpr std::array<std::uint64_t, packet_type_count> radio_turns{1, 1, 2, 10, 30, 30, 15};
constexpr std::array<std::uint64_t, packet_type_count> satellite_turns{1, 1, 0, 0, 0, 0, 0};
} // namespace

void telemetry_schedule::set_period(link_id link, double period_s, double now_s) {
    auto& e = links_[index(link)];
    e.period_s = period_s;
    e.next_s = now_s;
}

void telemetry_schedule::request(packet_type type) {
    for (auto& e : links_)
        if (e.period_s > 0) e.requested[static_cast<std::size_t>(type)] = true;
}

void telemetry_schedule::request(packet_type type, link_id link) {
    links_[index(link)].requested[static_cast<std::size_t>(type)] = true;
}

void telemetry_schedule::request_all(link_id link) { links_[index(link)].requested.fill(true); }

std::vector<packet_type> telemetry_schedule::take_due(link_id link, double now_s) {
    auto& e = links_[index(link)];
    auto& turns = link == link_id::iridium ? satellite_turns : radio_turns;
    bool due = e.period_s > 0 && now_s >= e.next_s;
    std::vector<packet_type> out;
    for (std::size_t i = 0; i < packet_type_count; ++i) {
        if (e.requested[i] || (due && turns[i] > 0 && e.turn % turns[i] == 0))
            out.push_back(static_cast<packet_type>(i));
        e.requested[i] = false;
    }
    if (due) {
        ++e.turn;
        // Missed ones are skipped.
        e.next_s += e.period_s * std::max(1.0, std::ceil((now_s - e.next_s) / e.period_s + 1e-9));
    }
    return out;
}

double telemetry_schedule::next_s() const {
    double next = std::numeric_limits<double>::infinity();
    for (auto& e : links_) {
        if (e.period_s > 0) next = std::min(next, e.next_s);
        for (bool requested : e.requested)
            if (requested) next = -std::numeric_limits<double>::infinity();
    }
    return next;
}

} // namespace atirma::simulator
