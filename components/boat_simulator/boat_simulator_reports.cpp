#include <components/boat_simulator/boat_simulator.hpp>

#include <algorithm>

// Reports about the boat: the state of its links from its side, and the ground truth.
namespace atirma {

link_status boat_simulator::radio_status() const {
    link_status told;
    told.link = link_id::xbee;
    told.up = port_ && port_->modem_ready() && radio_on_;
    told.queued = static_cast<std::uint16_t>(std::min<std::size_t>(boat_->queued(link_id::xbee), 65535));
    told.sent = static_cast<std::uint32_t>(sent_);
    told.failed = static_cast<std::uint32_t>(failed_);
    told.rssi_dbm = rssi_dbm_;
    told.last_heard_age_s = std::chrono::duration<float>(now() - heard_at_).count();
    return told;
}

link_status boat_simulator::uplink_status() const {
    const auto& link = uplink_->link();
    const auto& counted = link.counters();
    link_status told;
    told.link = link_id::gprs;
    told.up = uplink_->connected();
    told.queued = static_cast<std::uint16_t>(std::min<std::size_t>(link.waiting(), 65535));
    told.sent = static_cast<std::uint32_t>(counted.sent);
    told.failed = static_cast<std::uint32_t>(counted.resent);
    told.last_heard_age_s = std::chrono::duration<float>(now() - std::max(link.heard_at(), started_)).count();
    return told;
}

ground_truth boat_simulator::truth() const {
    auto where = boat_->location_now();
    auto how = boat_->navigation_now();
    auto air = boat_->true_wind();
    ground_truth told;
    told.at = std::chrono::floor<std::chrono::milliseconds>(wall());
    told.model_time_s = std::chrono::duration<double>(model_now()).count();
    told.latitude_deg = where.latitude_deg;
    told.longitude_deg = where.longitude_deg;
    told.speed_over_ground_mps = where.speed_over_ground_mps;
    told.course_over_ground_deg = where.course_over_ground_deg;
    told.distance_sailed_m = where.distance_sailed_m;
    told.heading_deg = how.heading_deg;
    told.heel_deg = how.heel_deg;
    told.wind_speed_mps = static_cast<float>(air.speed_mps);
    told.wind_from_deg = static_cast<float>(air.from_deg);
    told.mode = how.mode;
    told.in_irons = how.in_irons;
    told.waypoint_index = how.waypoint_index;
    told.waypoint_count = how.waypoint_count;
    told.laps = how.laps;
    told.boot = boat_->boot();
    told.modem_ready = port_ && port_->modem_ready();
    told.packets_sent = sent_;
    told.packets_failed = failed_;
    told.packets_queued = boat_->queued(link_id::xbee);
    if (backlog_) {
        told.radio_waiting = backlog_->waiting();
        told.radio_sent_again = backlog_->sent_again();
    }
    told.telecommands_heard = heard_ + (iridium_ ? iridium_->telecommands_heard() : 0);
    told.packets_refused = boat_->refused_packets();
    if (uplink_) {
        const auto& counted = uplink_->link().counters();
        told.gprs_connected = uplink_->connected();
        told.gprs_waiting = uplink_->link().waiting();
        told.gprs_acknowledged = counted.acknowledged;
        told.gprs_resent = counted.resent;
        told.gprs_dropped = counted.dropped;
    }
    return told;
}

} // namespace atirma
