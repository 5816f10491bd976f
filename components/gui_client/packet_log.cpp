#include <components/gui_client/packet_log.hpp>

namespace atirma::console {

void packet_log::add(const std::string& path, const telemetry_packet& packet, bool duplicate, utc_time now) {
    auto raw = std::make_shared<raw_packet>();
    raw->number = ++count_;
    raw->path = path;
    raw->arrived_at = now;
    raw->duplicate = duplicate;
    raw->packet = packet;
    packets_.push_back(std::move(raw));
    if (packets_.size() > most_) packets_.pop_front();
    shared_.reset();
}

std::shared_ptr<const packet_log::list> packet_log::packets() {
    if (!shared_) shared_ = std::make_shared<const list>(packets_.begin(), packets_.end());
    return shared_;
}

} // namespace atirma::console
