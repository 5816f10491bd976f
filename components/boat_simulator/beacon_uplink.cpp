#include <components/boat_simulator/beacon_uplink.hpp>

#include <components/iridium/bundle.hpp>

namespace atirma {

beacon_uplink::beacon_uplink(ise::loop& on, ise::logger log, iridium::sbd_port_options options)
    : log_(log), port_(on, log, std::move(options)) {
    port_.on_event = [this](const iridium::sbd_event& event) { on_event(event); };
}

void beacon_uplink::carry(simulator::second_controller& from) {
    for (auto& raw : from.take_packets()) waiting_.push_front(std::move(raw));
    if (!from.has_power()) waiting_.clear();
    if (waiting_.size() > max_waiting) waiting_.resize(max_waiting);
    if (waiting_.empty() || !port_.ready() || port_.has_message()) return;
    std::vector<ise::bytes> packets(waiting_.begin(), waiting_.end());
    std::size_t taken = 0;
    auto message = iridium::bundle(packets, iridium::max_mo_bytes, taken);
    auto given = port_.send(std::move(message));
    if (!given) return log_.warning("a message of the beacon was not taken", {{"cause", given.error().message()}});
    in_hand_.assign(packets.begin(), packets.begin() + static_cast<std::ptrdiff_t>(taken));
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(taken));
}

void beacon_uplink::on_event(const iridium::sbd_event& event) {
    if (std::holds_alternative<iridium::sbd_sent>(event)) {
        ++sent_;
        in_hand_.clear();
    } else if (const auto* lost = std::get_if<iridium::sbd_gave_up>(&event); lost && lost->message) {
        log_.warning("a message of the beacon was lost; it is sent again", {{"cause", lost->reason}});
        for (auto& raw : in_hand_) waiting_.push_back(std::move(raw)); // behind what is newer
        in_hand_.clear();
    }
}

} // namespace atirma
