#include <components/boat_simulator/boat_simulator.hpp>

#include <algorithm>

// Reports about the boat: the state of its links from its side, and the ground truth.
namespace atirma {

link_status boat_simulator::radio_status() const {
    link_status result;
    result.link = link_id::xbee;
    result.up = port_ && port_->modem_ready() && radio_on_;
    result.queued = static_cast<std::uint16_t>(std::min<std::size_t>(boat_->queued(link_id::xbee), 65535));
    result.sent = static_cast<std::uint32_t>(sent_);
    result.failed = static_cast<std::uint32_t>(failed_);
    result.rssi_dbm = rssi_dbm_;
    result.last_heard_age_s = std::chrono::duration<float>(now() - heard_at_).count();
    return result;
}

link_status boat_simulator::uplink_status() const {
    const auto& link = uplink_->link();
    const auto& counted = link.counters();
    link_status result;
    result.link = link_id::gprs;
    result.up = uplink_->connected();
    result.queued = static_cast<std::uint16_t>(std::min<std::size_t>(link.waiting(), 65535));
    result.sent = static_cast<std::uint32_t>(counted.sent);
    result.failed = static_cast<std::uint32_t>(counted.resent);
    result.last_heard_age_s = std::chrono::duration<float>(now() - std::max(link.heard_at(), started_)).count();
    return result;
}

ground_truth boat_simulator::truth() const {
    auto where = boat_->location_now();
    auto how = boat_->navigation_now();
    auto air = boat_->true_wind();
    ground_truth result;
    result.at = std::chrono::floor<std::chrono::milliseconds>(wall());
    result.model_time_s = std::chrono::duration<double>(model_now()).count();
    result.latitude_deg = where.latitude_deg;
    result.longitude_deg = where.longitude_deg;
    result.speed_over_ground_mps = where.speed_over_ground_mps;
    result.course_over_ground_deg = where.course_over_ground_deg;
    result.distance_sailed_m = where.distance_sailed_m;
    result.heading_deg = how.heading_deg;
    result.heel_deg = how.heel_deg;
    result.wind_speed_mps = static_cast<float>(air.speed_mps);
    result.wind_from_deg = static_cast<float>(air.from_deg);
    result.mode = how.mode;
    result.in_irons = how.in_irons;
    result.remote_control = how.remote_control;
    result.main_power = boat_->main_power();
    result.main_controller = boat_->main_controller();
    if (const auto* second = boat_->second()) {
        result.beacon_transmits = second->transmits();
        result.beacon_battery_percent = static_cast<float>(second->battery_percent());
    }
    if (beacon_) result.beacon_messages = beacon_->sent();
    result.waypoint_index = how.waypoint_index;
    result.waypoint_count = how.waypoint_count;
    result.laps = how.laps;
    result.boot = boat_->boot();
    result.modem_ready = port_ && port_->modem_ready();
    result.packets_sent = sent_;
    result.packets_failed = failed_;
    result.packets_queued = boat_->queued(link_id::xbee);
    if (backlog_) {
        result.radio_waiting = backlog_->waiting();
        result.radio_sent_again = backlog_->sent_again();
    }
    result.telecommands_heard = heard_ + (iridium_ ? iridium_->telecommands_heard() : 0);
    result.packets_refused = boat_->refused_packets();
    if (uplink_) {
        const auto& counted = uplink_->link().counters();
        result.gprs_connected = uplink_->connected();
        result.gprs_waiting = uplink_->link().waiting();
        result.gprs_acknowledged = counted.acknowledged;
        result.gprs_resent = counted.resent;
        result.gprs_dropped = counted.dropped;
    }
    return result;
}

} // namespace atirma
