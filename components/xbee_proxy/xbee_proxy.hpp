#pragma once
#include <components/boat/telecommand_tracker.hpp>
#include <components/xbee/modem_port.hpp>
#include <components/xbee_proxy/local_modem.hpp>
#include <components/xbee_proxy/services.hpp>

#include <ise/component/component.hpp>

#include <memory>
#include <optional>

namespace atirma {

struct xbee_proxy_options {
    xbee::port_options port;
    std::uint64_t boat_address = 0x0013A20040000002;        ///< of the boat's modem; 0: whoever is heard last
    ise::duration local_period = std::chrono::seconds(2);   ///< of xb_local
    ise::duration send_time = std::chrono::seconds(30);     ///< that one attempt may take; then it is tried again
    ise::duration receipt_period = std::chrono::seconds(5); ///< of receipts for telemetry that is safe
    link_policy policy;
    /// Path or role of the store that keeps telemetry before the boat gets a receipt: `atirma/communication`; empty: no
    /// receipts.
    std::string store_at;
    /// Key file (seal_store.hpp): telecommands are sealed, and what is not of the boat is dropped. Empty:
    /// everybody on the link is believed.
    std::string radio_key_file;
    bool radio_secondary = false; ///< its counters are those of the secondary lane
};

/// The boat over the XBee radio: what comes through the serial port of a modem is published, telecommands go the other
/// way. The port may vanish and come back; telecommands wait for it within their validity. Services: `telemetry`,
/// `telecommand`, `telecommand_state` (components/boat/services.hpp), `xb_local`, `xb_local_param` (services.hpp).
class xbee_proxy final : public ise::component {
public:
    explicit xbee_proxy(xbee_proxy_options options = xbee_proxy_options());
    ~xbee_proxy() override;

private:
    struct radio; // what lives from one run() to the next

    ise::task<> run() override;
    void provide_all();
    void on_radio_event(const xbee::client_event& event);
    std::optional<ise::bytes> opened(const xbee::packet_received& packet);
    void on_packet(const xbee::packet_received& packet);
    void on_sent(const xbee::send_outcome& outcome);
    ise::task<> keep();
    ise::task<> give_receipts();
    void publish_local();
    /// Gives the telecommands that are due to the radio.
    void give();
    utc_time clock() const;

    xbee_proxy_options options_;
    std::unique_ptr<radio> radio_;
};

} // namespace atirma
