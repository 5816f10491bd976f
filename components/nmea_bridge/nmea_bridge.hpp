#pragma once
#include <components/boat/newest_reports.hpp>
#include <components/nmea_bridge/line_outlet.hpp>

#include <ise/component/component.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace atirma {

struct nmea_bridge_options {
    std::vector<std::string> telemetry; ///< paths of the proxies that it listens to
    outlet_options nmea;
    outlet_options signalk;
    std::string vessel = "A-Tirma";                 ///< its name, for Signal K
    std::string vessel_uuid;                        ///< its identity there; empty: made from its name
    std::chrono::seconds stale_after{60};           ///< a position that was measured before is none any more
    ise::duration period = std::chrono::seconds(5); ///< in which it is said that there is none
    std::function<void(const std::string& where)> on_listening; ///< on the component's loop, for each TCP endpoint
};

/// The boat for programs that speak NMEA 0183 or Signal K: each report of the boat is told once, with the time of its
/// measurement, when it is the newest of its kind over all links; a position that has grown old is told as none.
/// Services: `bridge` (services.hpp). A proxy that is not there is waited for. A port that is taken ends `run()` with
/// an error.
class nmea_bridge final : public ise::component {
public:
    explicit nmea_bridge(nmea_bridge_options options = nmea_bridge_options());
    ~nmea_bridge() override;

private:
    ise::task<> run() override;
    ise::task<> follow(std::string path);
    void take(const telemetry_packet& packet);
    std::string nmea_now(std::optional<std::size_t> kind) const;
    std::string signalk_now(std::optional<std::size_t> kind) const;
    bool is_fresh(utc_time measured_at) const;
    utc_time clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }
    bridge_status status() const;

    nmea_bridge_options options_;
    newest_reports known_;
    std::unique_ptr<line_outlet> nmea_, signalk_;
    std::uint64_t packets_ = 0;
};

} // namespace atirma
