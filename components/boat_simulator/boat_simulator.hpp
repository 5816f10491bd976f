#pragma once
#include <components/boat_simulator/beacon_uplink.hpp>
#include <components/boat_simulator/boat_memory.hpp>
#include <components/boat_simulator/iridium_uplink.hpp>
#include <components/boat_simulator/radio_backlog.hpp>
#include <components/boat_simulator/scene_wind.hpp>
#include <components/boat_simulator/services.hpp>
#include <components/boat_simulator/simulated_boat.hpp>
#include <components/gprs/uplink_port.hpp>
#include <components/seal_store/seal_store.hpp>
#include <components/xbee/modem_port.hpp>

#include <ise/component/component.hpp>
#include <ise/core/log_limiter.hpp>

#include <functional>
#include <memory>
#include <string>

namespace atirma {

struct boat_simulator_options {
    std::string course = "T1"; ///< T1, T2, or "none": it stays at its start
    std::string wind_file;     ///< a recorded series (CSV); empty: the wind below
    double wind_speed_mps = 6;
    double wind_from_deg = 45;
    bool gusts = true; ///< around that wind, by the seed
    std::uint64_t seed = 1;
    double speedup = 1;                               ///< 0.1 … 1000: of the boat's model time, never of deadlines
    std::uint16_t boot = 0;                           ///< 0: random, different at each start
    xbee::port_options port;                          ///< the boat's own modem; an empty device: it has no radio
    std::uint64_t shore_address = 0x0013A20040000001; ///< of the shore's modem
    iridium_uplink_options iridium;                   ///< the boat's 9602; an empty device: it has none
    /// The second controller's own 9602; an empty device: the boat has no second controller.
    iridium::sbd_port_options beacon;
    double beacon_period_s = 600; ///< of its positions
    std::string gprs;             ///< where it connects over GPRS: tcp, tls or udp; empty: it does not
    gprs::uplink_options uplink;  ///< of that link
    double gprs_period_s = 5;     ///< of telemetry there, at the start; 0 is off
    /// File with its state over a loss of power (boat_memory.hpp): it then continues at its position. Empty: no memory.
    std::string memory_file;
    /// File of the radio's key (seal_store.hpp): what the boat sends is sealed, and it refuses what is not. Empty: it
    /// obeys everybody on its links.
    std::string radio_key_file;
    std::string fence_file;        ///< GeoJSON (components/coast): the boat stays within it; empty: it has no fence
    bool raw_telecommands = false; ///< whether raw telecommands go to its controller
    bool keeps_off_coast = true;   ///< it turns back before the coast of components/coast
    /// Error of the boat's clock, which GPS does not set then; 0: GPS sets it, and it is right.
    double clock_off_s = 0;
    /// Called when a telecommand was executed, with its answer; for tests.
    std::function<void(const acknowledgement&)> on_executed;
    ise::duration truth_period = std::chrono::milliseconds(500);
};

/// A boat that sails in real time (times `speedup`), with its own modem on a serial port and its own connection over
/// GPRS. It sends telemetry and executes each telecommand once, over whichever link it arrives. Services:
/// `ground_truth`, `scene` (services.hpp). An unreadable wind file, an unknown course and numbers out of range end
/// `run()` with an error.
class boat_simulator final : public ise::component {
public:
    explicit boat_simulator(boat_simulator_options options = boat_simulator_options()) : options_(std::move(options)) {}

    /// Applies the mean speed and direction of the wind in `now` while it sails; a scene (services.hpp) has precedence.
    /// Throws errc::refused if a recorded wind is used.
    void change(const boat_simulator_options& now);

    /// The position of the boat; empty before its start. On the component's loop.
    const simulator::simulated_boat* boat() const noexcept { return boat_.get(); }
    /// The number of packets without a receipt of the shore over the radio. On the component's loop.
    std::size_t radio_waiting() const noexcept { return backlog_ ? backlog_->waiting() : 0; }

private:
    ise::task<> run() override;
    std::shared_ptr<const simulator::wind_source> make_wind();
    std::shared_ptr<const sea_limits> read_limits();
    void make_boat();
    std::uint16_t drawn_boot();
    void sail();
    void open_memory(simulator::boat_options& made);
    void remember();
    void kept(const ise::result<void>& outcome);
    void tell_executed();
    void send();
    void hold_telemetry();
    void keep_until_receipt(const ise::bytes& raw);
    void ask_duty_cycle();
    void on_receipt(ise::bytes_view raw);
    void send_uplink();
    void heard(link_id link, ise::bytes_view raw);
    void open_seal();
    std::optional<ise::bytes> opened(link_id link, ise::bytes_view raw);
    ise::bytes sealed(link_id link, ise::bytes raw) const;
    void send_notices();
    void tell_keys(const seal::boat_keys& before);
    void on_radio_event(const xbee::client_event& event);
    scene set_scene(const scene_request& request);
    std::optional<simulator::remote_helm> helm_of(const scene_request& request) const;
    ground_truth truth() const;
    link_status radio_status() const;
    link_status uplink_status() const;
    simulator::model_time model_now() const;

    boat_simulator_options options_;
    std::shared_ptr<simulator::scene_wind> wind_;
    std::unique_ptr<simulator::simulated_boat> boat_;
    std::unique_ptr<xbee::modem_port> port_;
    std::optional<simulator::radio_backlog> backlog_; // of the radio
    std::vector<ise::bytes> not_receipted_;           // before the restart
    std::optional<xbee::token> asked_duty_;
    ise::time_point ask_duty_at_{};
    std::unique_ptr<iridium_uplink> iridium_;
    std::unique_ptr<beacon_uplink> beacon_; // of the second controller
    std::unique_ptr<gprs::uplink_port> uplink_;
    std::unique_ptr<seal::boat_links> seal_; // empty: no key
    ise::log_limiter quiet_;
    std::optional<boat_memory> memory_;
    bool memory_is_new_ = false; ///< its file was damaged and replaced
    std::string memory_trouble_;
    std::vector<ise::bytes> not_acknowledged_; // before the restart
    ise::time_point remember_at_{};
    std::optional<std::uint64_t> commands_kept_; ///< of those executed in this run; nothing: also none of before
    std::uint64_t executed_told_ = 0;
    std::uint32_t forgotten_ = 0; // of the uplink's numbers
    ise::time_point started_{};
    ise::time_point heard_at_{};
    bool radio_on_ = true;
    std::optional<xbee::token> asked_rssi_; // of the modem, about the last packet heard
    std::int16_t rssi_dbm_ = 0;             // 0: nothing was heard yet
    std::uint64_t sent_ = 0, failed_ = 0, heard_ = 0;
};

} // namespace atirma
