#include "iridium_types.hpp"
#include "iridium_curl.hpp"
#include "radio_key.hpp"

#include <components/boat/recall.hpp>
#include <components/iridium_gateway/iridium_gateway.hpp>
#include <components/iridium_modem/iridium_modem.hpp>
#include <components/iridium_proxy/iridium_proxy.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using ise::component_type;
using ise::parameter_kind;

struct proxy_settings {
    iridium_proxy_options options;
    std::string imap_server, smtp_server, mail_user, ca_file;
};

struct gateway_settings {
    iridium_gateway_options options;
    std::vector<std::string> imeis;
    double ring_delay_s = 2;
};

component_type proxy_type() {
    component_type type("iridium-proxy", "the boat over Iridium SBD", "atirma/shore/iridium");
    auto settings = std::make_shared<proxy_settings>();
    auto* options = &settings->options;
    auto& set = type.parameters;
    set.add("imei", options->imei, "IMEI of the boat's modem, 15 digits");
    set.add("beacon-imei", options->beacon_imei,
            "IMEI of the modem of the boat's second controller; empty: it has none");
    set.add("database", options->database, "file for messages, telecommands and cost (SQLite)")
        .kind(parameter_kind::path);
    set.add("store", options->store_at,
            "store that must have a message's telemetry: atirma/communication; empty: it waits for a subscriber");
    add_radio_key(set, options->radio_key_file, options->radio_secondary);
    set.add("webhook", options->webhook, "endpoint for the gateway's posts, tcp://address:port; empty: none")
        .kind(parameter_kind::endpoint);
    set.add("webhook-path", options->webhook_path, "path of the web hook");
    set.add("jwt-key", options->jwt_key_file,
            "public key or certificate (PEM): each post must carry a token signed with it")
        .kind(parameter_kind::path);
    set.add("gateway-addresses", options->gateway_addresses,
            "addresses and networks of the gateway, 12.47.179.11,192.0.2.0/24: other addresses are refused at webhook "
            "and directip; beyond loopback directip needs it, and webhook needs it or jwt-key");
    set.add("directip", options->directip, "endpoint for the gateway's DirectIP, tcp://address:port; empty: none")
        .kind(parameter_kind::endpoint);
    set.add("send-by", options->send_by, "interface for telecommands to the gateway")
        .one_of({"http", "directip", "mail", "none"});
    set.add("url", options->rockblock.url, "URL of the gateway's web service for telecommands")
        .kind(parameter_kind::url);
    set.add("user", options->rockblock.username,
            "user of the gateway's account; the password is in ATIRMA_ROCKBLOCK_PASSWORD");
    set.add("send-directip", options->send_directip, "tcp://host:port of the gateway's DirectIP")
        .kind(parameter_kind::url);
    set.add("imap", settings->imap_server, "imaps://server of the mailbox for the gateway's mails; empty: none")
        .kind(parameter_kind::url);
    set.add("smtp", settings->smtp_server, "smtps://server for mails to the gateway").kind(parameter_kind::url);
    set.add("mail-user", settings->mail_user, "user of both; the password is in ATIRMA_MAIL_PASSWORD");
    set.add("mail-from", options->mail_from, "sender of mails to the gateway");
    set.add("mail-to", options->mail_to, "the gateway's address for messages");
    set.add("gateway-mail", options->gateway_mail, "sender of the gateway's mails");
    set.add("mail-authserv", options->mail_authserv,
            "name of the mail server whose Authentication-Results are trusted");
    set.add("mail-unchecked", options->mail_unchecked,
            "trust the sender address of mails: only if no other sender can reach the mailbox");
    set.add("ca-file", settings->ca_file, "authorities to trust (PEM) instead of the system's")
        .kind(parameter_kind::path);
    set.add("daily-budget", options->daily_budget, "credits a day (UTC) for telecommands; 0: unlimited");
    set.add("monthly-budget", options->monthly_budget, "credits a month (UTC) for telecommands; 0: unlimited");
    set.add("credit-bytes", options->bytes_per_credit, "bytes that a credit pays for").range(1, 340);
    type.provides(services::telemetry)
        .provides(services::telecommand)
        .provides(services::telecommand_state)
        .provides(services::telecommand_recall)
        .provides(services::iridium_account);
    type.requires_(services::telemetry_store);
    type.reads("ATIRMA_ROCKBLOCK_PASSWORD").reads("ATIRMA_MAIL_PASSWORD");
    type.make = [settings] {
        auto made = settings->options;
        made.make_http_client = [settings](ise::loop& on) {
            curl_http_options http;
            http.ca_file = settings->ca_file;
            return make_curl_http_client(on, http);
        };
        auto password = [](ise::loop& on) { return on.env().variable("ATIRMA_MAIL_PASSWORD").value_or(""); };
        if (!settings->imap_server.empty()) {
            made.open_mailbox = [settings, password](ise::loop& on) {
                imap_options imap;
                imap.server = settings->imap_server;
                imap.user = settings->mail_user;
                imap.password = password(on);
                imap.ca_file = settings->ca_file;
                return make_imap_mailbox(on, imap);
            };
        }
        if (!settings->smtp_server.empty()) {
            made.make_mail_sender = [settings, password](ise::loop& on) {
                smtp_options smtp;
                smtp.server = settings->smtp_server;
                smtp.user = settings->mail_user;
                smtp.password = password(on);
                smtp.ca_file = settings->ca_file;
                return make_smtp_sender(on, smtp);
            };
        }
        return std::make_unique<iridium_proxy>(std::move(made));
    };
    return type;
}

component_type modem_type() {
    component_type type("iridium-modem", "an emulated 9602 on a serial port", "atirma/iridium/modem");
    auto options = std::make_shared<iridium_modem_options>();
    auto& set = type.parameters;
    set.add("port", options->port, "link to its serial port").kind(parameter_kind::path);
    set.add("imei", options->imei, "15 digits");
    set.add("gateway", options->gateway, "component to open sessions with; empty: no network service");
    set.add("min-session", options->min_session_s, "duration of a session").range(0, 600).unit("s");
    set.add("max-session", options->max_session_s, "duration of a session").range(0, 600).unit("s");
    set.add("failures", options->failures, "fraction of sessions that fail on the radio link").range(0, 1);
    set.add("sky", options->sky_free, "free, or none at first");
    set.add("seed", options->seed, "random seed of durations and failures");
    type.provides(services::iridium_sky_control).provides(services::iridium_sky);
    type.requires_(services::sbd_session).requires_(services::sbd_ring);
    type.make = [options] { return std::make_unique<iridium_modem>(*options); };
    return type;
}

component_type gateway_type() {
    component_type type("iridium-gateway", "an emulated gateway of Iridium and RockBLOCK", "atirma/iridium/gateway");
    auto settings = std::make_shared<gateway_settings>();
    auto& options = settings->options;
    settings->imeis = {iridium_modem_options().imei};
    auto& set = type.parameters;
    set.add("imei", settings->imeis, "IMEI of a modem of its account");
    set.add("user", options.model.username, "user of the gateway's account");
    set.add("password", options.model.password, "password of the gateway's account");
    set.add("listen-http", options.listen, "endpoint for POST /rockblock/MT, tcp://address:port; empty: none")
        .kind(parameter_kind::endpoint);
    set.add("listen-directip", options.directip_listen, "endpoint for DirectIP, tcp://address:port; empty: none")
        .kind(parameter_kind::endpoint);
    set.add("post-to", options.post_to, "URL of the web hook that gets the boat's messages; empty: none")
        .kind(parameter_kind::url);
    set.add("post-json", options.post_json, "post JSON instead of forms");
    set.add("sign-with", options.sign_with, "private key (PEM) for the tokens of posts").kind(parameter_kind::path);
    set.add("directip-to", options.directip_to, "tcp://host:port that gets the boat's messages; empty: none")
        .kind(parameter_kind::url);
    set.add("delay", options.delivery_delay_s, "mean time from a session to its post").range(0, 3600).unit("s");
    set.add("ring-delay", settings->ring_delay_s, "from a message's arrival to the ring alert")
        .range(0, 3600)
        .unit("s");
    set.add("failures", options.session_failures, "fraction of sessions that fail").range(0, 1);
    set.add("duplicates", options.duplicates, "fraction of posts sent twice").range(0, 1);
    set.add("seed", options.model.seed, "random seed of delays, failures and duplicates");
    type.provides(services::sbd_session).provides(services::sbd_ring);
    type.provides(services::iridium_gateway_control).provides(services::iridium_gateway_status);
    type.make = [settings] {
        auto made = settings->options;
        made.model.imeis = {settings->imeis.begin(), settings->imeis.end()};
        made.ring_delay =
            std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(settings->ring_delay_s));
        return std::make_unique<iridium_gateway>(std::move(made));
    };
    return type;
}

} // namespace

void add_iridium_types(std::vector<component_type>& to) {
    to.push_back(proxy_type());
    to.push_back(modem_type());
    to.push_back(gateway_type());
}

} // namespace atirma
