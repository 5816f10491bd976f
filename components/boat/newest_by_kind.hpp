#pragma once
#include <components/boat/services.hpp>

#include <algorithm>
#include <map>

namespace atirma {

/// Tells packets that are older than what is known of their kind: they fill the track and never become the current
/// state, whichever link brought them late. Without I/O.
class newest_by_kind {
public:
    /// A boat's clock that runs ahead by more is not believed: a packet from the future counts by its reception.
    static constexpr std::chrono::minutes max_lead{0};

    void know(std::uint8_t kind, utc_time measured_at) {
        auto& newest = newest_[kind];
        newest = std::max(newest, measured_at);
    }
    /// Whether it is history; remembers it.
    bool is_history(const telemetry_packet& packet) {
        if (packet.history || packet.raw.size() < 2) return true;
        auto at = plausible_time(packet);
        auto& newest = newest_[std::to_integer<std::uint8_t>(packet.raw[1])];
        if (at < newest) return true;
        newest = at;
        return false;
    }

private:
    std::map<std::uint8_t, utc_time> newest_;
};

} // namespace atirma
