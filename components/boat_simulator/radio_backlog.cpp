#include <components/boat_simulator/radio_backlog.hpp>

#include <algorithm>
#include <optional>

namespace atirma::simulator {
namespace {

std::optional<packet_name> name_in(ise::bytes_view raw) {
    auto message = parse_telemetry(raw);
    if (!message) return std::nullopt;
    return packet_name(message->header.boot, message->header.sequence);
}

} // namespace

void radio_backlog::sent(ise::time_point now, packet_name name, kept_packet& packet) {
    held_.erase(name);
    due_.erase({packet.due, name});
    packet.pause = packet.pause.count() == 0 ? first_pause : std::min(packet.pause * 2, max_pause);
    packet.due = now + packet.pause;
    due_.emplace(packet.due, name);
}

void radio_backlog::hold(packet_name name, kept_packet& packet) {
    due_.erase({packet.due, name});
    packet.pause = {};
    held_.insert(name);
}

radio_backlog::kept_packet& radio_backlog::keep(packet_name name, ise::bytes raw) {
    while (kept_.size() >= capacity) {
        auto oldest = kept_.find(order_.front());
        order_.pop_front();
        if (oldest == kept_.end()) continue;
        gone_.push_back(oldest->first);
        ++given_up_;
        forget(oldest);
    }
    if (order_.size() >= 2 * capacity) std::erase_if(order_, [this](const auto& one) { return !kept_.contains(one); });
    order_.push_back(name);
    auto& made = kept_[name];
    made.raw = std::move(raw);
    return made;
}

void radio_backlog::forget(std::map<packet_name, kept_packet>::iterator which) {
    held_.erase(which->first);
    due_.erase({which->second.due, which->first});
    kept_.erase(which);
}

void radio_backlog::put_held(ise::bytes raw) {
    if (auto name = name_in(raw)) hold(*name, keep(*name, std::move(raw)));
}

bool radio_backlog::put(ise::time_point now, const ise::bytes& raw) {
    auto name = name_in(raw);
    if (!name) return true;
    auto& packet = keep(*name, raw);
    bool goes = alive(now) || now >= probe_at_;
    if (!alive(now) && goes) probe_at_ = now + probe_period;
    if (goes) sent(now, *name, packet);
    else hold(*name, packet);
    return goes;
}

ise::bytes radio_backlog::next(ise::time_point now) {
    if (!alive(now) || duty_percent_ >= max_duty_percent) return {};
    // Held packets are sent to any shore that hears the boat; sent ones are repeated only while receipts arrive.
    std::optional<packet_name> which;
    if (!held_.empty()) which = *held_.begin();
    else if (receipts_ && now - receipted_at_ < 2 * alive_for && !due_.empty() && due_.begin()->first <= now) {
        which = due_.begin()->second;
        ++sent_again_;
    }
    if (!which) return {};
    auto& packet = kept_.at(*which);
    sent(now, *which, packet);
    return packet.raw;
}

void radio_backlog::not_taken(ise::bytes_view raw) {
    auto name = name_in(raw);
    if (!name) return;
    auto found = kept_.find(*name);
    if (found != kept_.end()) hold(*name, found->second);
}

std::vector<packet_name> radio_backlog::on_receipt(ise::time_point now, const telemetry_receipt& result) {
    heard_at_ = receipted_at_ = now;
    receipts_ = true;
    std::vector<packet_name> made;
    for (const auto& name : result.packets) {
        auto found = kept_.find(name);
        if (found == kept_.end() || held_.contains(name)) continue; // never sent, so no shore can have it
        forget(found);
        made.push_back(name);
    }
    return made;
}

} // namespace atirma::simulator
