#pragma once
#include <components/iridium/directip_exchange.hpp>
#include <components/iridium_gateway/gateway_model.hpp>
#include <components/mail/mail.hpp>
#include <ise/http/http_client.hpp>
#include <ise/http/http_server.hpp>

#include <ise/component/component.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace atirma {

struct iridium_gateway_options {
    gateway_model_options model;
    double session_failures = 0;
    double duplicates = 0;
    double delivery_delay_s = 2;

    // MO messages go to all of these that are given.
    std::string post_to;     ///< "http://127.0.0.1:7480/rockblock/mo"
    bool post_json = false;  ///< else forms
    std::string sign_with;   ///< a private key (PEM file) for the tokens of posts; empty: none
    std::string directip_to; ///< "tcp://127.0.0.1:10800"
    std::string mail_to;     ///< needs `make_mail_sender`
    std::function<std::unique_ptr<ise::http_client>(ise::loop&)> make_http_client; ///< empty: stream_http_client
    std::function<std::unique_ptr<mail_sender>(ise::loop&)> make_mail_sender;

    // MT messages come through these.
    std::string listen = "tcp://127.0.0.1:7481"; ///< POST /rockblock/MT; empty: not
    std::string directip_listen;                 ///< empty: not
    std::function<std::unique_ptr<mailbox>(ise::loop&)> open_mailbox;

    ise::duration answer_time = std::chrono::seconds(3); ///< that a web hook has for its 200
    ise::duration ring_delay = std::chrono::seconds(2);  ///< from a message's arrival to the ring alert
};

/// An emulated gateway: takes the sessions of emulated modems (`sbd_session`), delivers what they sent by web hook,
/// DirectIP or mail until it is taken, queues what is submitted for them, and rings. Seeded. Services: services.hpp.
class iridium_gateway final : public ise::component {
public:
    explicit iridium_gateway(iridium_gateway_options options = iridium_gateway_options());
    ~iridium_gateway() override;

    /// Where messages may be submitted, once it listens. On the component's loop.
    std::optional<ise::endpoint> submissions_at() const;
    std::optional<ise::endpoint> directip_at() const;

private:
    struct state;

    ise::task<> run() override;
    void provide_all();
    void open_doors();
    iridium_gateway_state control(const iridium_gateway_request& request);
    sbd_session_reply session(const sbd_session_request& request);
    ise::http_response on_submission(const ise::http_request& request);
    ise::bytes on_directip(ise::bytes_view message);
    ise::task<> read_mails();
    ise::task<> answer_mail(mail_message mail);
    void turn();
    ise::task<> deliver(gateway_model::delivery what);
    ise::task<std::string> post(iridium::mo_message message);
    ise::task<std::string> connect(iridium::mo_message message);
    ise::task<std::string> mail(iridium::mo_message message);
    void ring(const std::string& imei);
    ise::task<> ring_later(std::string imei);
    std::chrono::sys_seconds wall_seconds() const;

    iridium_gateway_options options_;
    std::unique_ptr<state> state_;
};

} // namespace atirma
