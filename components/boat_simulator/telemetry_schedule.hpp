#pragma once
#include <components/boat/telemetry.hpp>

#include <array>
#include <vector>

namespace atirma::simulator {

/// The kinds of packets, by their place in `telemetry_body`.
enum class packet_type : std::uint8_t { location, navigation, wind, power, waypoints, configuration, link_status };
inline constexpr std::size_t packet_type_count = 7;

/// Schedules the packets on each link. Each link has a period: location and navigation are due once a period, others
/// every few periods, and changed ones at once.
class telemetry_schedule {
public:
    /// 0 (default): no telemetry on the link.
    void set_period(link_id link, double period_s, double now_s);
    double period_s(link_id link) const { return links_[index(link)].period_s; }

    /// Makes it due now, on every link that is not off.
    void request(packet_type type);
    /// The same on one link, even if that one is off.
    void request(packet_type type, link_id link);
    void request_all(link_id link);

    /// The packets due at `now_s`, each once, even if several were missed.
    std::vector<packet_type> take_due(link_id link, double now_s);
    /// The time of the next due packet; infinity if there is none.
    double next_s() const;

private:
    static std::size_t index(link_id link) { return static_cast<std::size_t>(link) % link_count; }
    struct entry {
        double period_s = 0;
        double next_s = 0;
        std::uint64_t turn = 0;
        std::array<bool, packet_type_count> requested{};
    };
    std::array<entry, link_count> links_;
};

} // namespace atirma::simulator
