#pragma once
#include <components/boat/link_budget.hpp>
#include <components/boat/telecommand_tracker.hpp>
#include <components/boat/telemetry_store.hpp>
#include <components/iridium/directip_exchange.hpp>
#include <components/iridium/message.hpp>
#include <components/iridium_proxy/mt_path.hpp>
#include <components/iridium_proxy/services.hpp>
#include <components/mail/mail.hpp>
#include <ise/http/http_client.hpp>
#include <ise/http/http_server.hpp>

#include <ise/component/component.hpp>

#include <functional>
#include <memory>
#include <string>

namespace atirma {

struct iridium_proxy_options {
    std::string imei;                    ///< of the boat's modem, 15 digits: others are refused
    std::string beacon_imei;             ///< of the second controller's own modem; empty: it has none
    std::string database = "iridium.db"; ///< what must survive; "memory:NAME" in tests

    /// Keeps telemetry before a message counts as handed on; nothing: it is published once somebody subscribes.
    std::shared_ptr<telemetry_store> store;
    std::string store_at; ///< the same, of the component at this path: atirma/communication

    // From the boat. What is empty or missing is not used; several may be.
    std::string webhook = "tcp://127.0.0.1:7480"; ///< where the gateway posts
    std::string webhook_path = "/rockblock/mo";
    std::string jwt_key_file; ///< public key or certificate (PEM): each post must carry a token of it
    /// Of the gateway, as iridium::address_list: at web hook and DirectIP connections from elsewhere are refused,
    /// unless these listen on loopback. Beyond it, DirectIP needs this list, and the web hook needs it or a key.
    std::string gateway_addresses;
    ise::http_limits http;
    std::string directip; ///< where the gateway's DirectIP connects: "tcp://0.0.0.0:10800"
    iridium::directip_limits directip_bounds;
    std::function<std::unique_ptr<mailbox>(ise::loop&)> open_mailbox; ///< where the gateway's mails arrive
    std::string gateway_mail = "sbdservice@sbd.iridium.com";          ///< who writes them
    std::string mail_authserv;   ///< the mail server whose Authentication-Results (RFC 8601) say whether that is true
    bool mail_unchecked = false; ///< believes `From:`: only where nobody else can mail there
    ise::duration mail_period = std::chrono::seconds(60); ///< between looks, where the mailbox does not tell

    // To the boat, by one way: "http", "directip", "mail", "none".
    std::string send_by = "http";
    rockblock_account rockblock; ///< an empty password: $ATIRMA_ROCKBLOCK_PASSWORD
    /// Empty: stream_http_client, without TLS.
    std::function<std::unique_ptr<ise::http_client>(ise::loop&)> make_http_client;
    std::string send_directip; ///< "tcp://host:port" of the gateway
    std::function<std::unique_ptr<mail_sender>(ise::loop&)> make_mail_sender;
    std::string mail_from;
    std::string mail_to = "data@sbd.iridium.com";

    /// Key file (seal_store.hpp): telecommands are sealed, and what is not of the boat is dropped. Empty:
    /// everybody on the link is believed.
    std::string radio_key_file;
    bool radio_secondary = false; ///< its counters are those of the secondary lane

    std::uint64_t daily_budget = 100; ///< credits a day (UTC) for telecommands; 0: unlimited
    std::uint64_t monthly_budget = 0; ///< the same for a month
    std::uint32_t bytes_per_credit = 50;
    ise::duration account_period = std::chrono::seconds(5);
    std::chrono::days keep{30}; ///< messages and decided telecommands
};

struct proxy_state;

/// The boat over Iridium SBD: what the gateway brings by web hook, DirectIP or mail is kept on disk, then published;
/// telecommands are queued on disk and given to the gateway by priority within a daily budget. Services: `telemetry`,
/// `telecommand`, `telecommand_state` (components/boat/services.hpp), `iridium_account` (services.hpp).
///
/// `run()` ends with an error where an option makes no sense, the database cannot be opened, or a port is taken.
class iridium_proxy final : public ise::component {
public:
    explicit iridium_proxy(iridium_proxy_options options = iridium_proxy_options());
    ~iridium_proxy() override;

    /// Where the gateway may post, once it listens: with the port that was given for port 0. On the component's loop.
    std::optional<ise::endpoint> webhook_at() const;
    std::optional<ise::endpoint> directip_at() const;

private:
    ise::task<> run() override;
    void check_options() const;
    std::unique_ptr<mt_path> make_path();
    void keep_what_is_open();
    void open_doors();
    void provide_all();

    // From the boat.
    ise::http_response on_post(const ise::http_request& request);
    ise::bytes on_directip(ise::bytes_view message, const std::string& peer);
    ise::task<> read_mails();
    ise::result<void> on_mail(const mail_message& mail);
    ise::result<void> accept(const iridium::mo_message& message, std::string_view path);
    bool is_ours(std::string_view imei) const;
    bool is_beacons(const iridium::mo_message& message) const { return message.imei == options_.beacon_imei; }
    void take_acknowledgements(const iridium::mo_message& message);
    void take_kept_acknowledgements();
    ise::result<ise::bytes> opened(ise::bytes raw);
    ise::result<ise::bytes> read_sealed(ise::bytes raw) const;
    ise::result<telemetry_message> telemetry_of(const iridium::mo_message& from, const ise::bytes& raw) const;
    ise::result<ise::bytes> sealed(const ise::bytes& raw);
    void hand_on();
    ise::task<> keep_messages();
    std::vector<telemetry_packet> hand_on(const iridium::mo_message& message, utc_time received_at);
    void refuse(std::string_view what, const std::string& peer, const std::string& why);

    // To the boat.
    ise::task<> send_all();
    link_budget budget();
    ise::result<void> keep_on_disk(const tracked_telecommand& entry);

    iridium_account account();
    void disk_trouble(const ise::failure& why);
    utc_time clock() const;

    iridium_proxy_options options_;
    std::unique_ptr<proxy_state> state_; // what lives from one run() to the next
};

} // namespace atirma
