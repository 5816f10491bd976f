#pragma once
#include <components/gui_client/view.hpp>

#include <optional>

namespace atirma::console {

/// The newest values that the boat reported, by its own clock: what comes late over a slow link never replaces a newer
/// value. Pure, bounded.
class boat_record {
public:
    explicit boat_record(std::size_t max_notices) : max_notices_(max_notices) {}

    /// True if it replaced the newest value of its kind.
    bool on_message(const telemetry_message& message, const telemetry_packet& packet, utc_time now);
    /// The boot number before, where the packet shows that the boat has started again.
    std::optional<std::uint16_t> on_boot(const telemetry_packet& packet);
    /// A telecommand set its mode then, possibly the one that it had: its time counts anew.
    void on_mode_set(utc_time executed_at);
    /// Something came from the boat at that time.
    void on_heard(utc_time at);
    const boat_view& view() const noexcept { return view_; }

private:
    bool take(const navigation& result, const telemetry_packet& packet, utc_time now);
    bool take(const location& result, const telemetry_packet& packet, utc_time now);
    bool take(const link_status& result, const telemetry_packet& packet, utc_time now);
    bool take(const notice& result, const telemetry_packet& packet, utc_time now);

    void count_mode();

    std::size_t max_notices_;
    boat_view view_;
    std::optional<std::uint16_t> boot_;
    utc_time boot_measured_{};
    utc_time mode_set_{};                             ///< by a telecommand
    utc_time mode_first_{}, other_last_{}, remote_{}; ///< measured: reports of this mode, another one, remote control
};

} // namespace atirma::console
