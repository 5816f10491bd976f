#pragma once
#include <components/curl/curl_transfers.hpp>
#include <components/mail/mail.hpp>

namespace atirma {

struct smtp_options {
    std::string server;         ///< "smtps://mail.example" (465), or "smtp://mail.example:587", which then starts TLS
    std::string user, password; ///< no user: no login
    std::string ca_file;        ///< PEM file of the authorities to trust; empty: those of the system
    bool clear_text = false;    ///< smtp:// without TLS where the server has none: on the own host only
    ise::duration within = std::chrono::seconds(60); ///< one mail, from connecting on
};

/// Sends mails by SMTP, each over a connection of its own. Errors: see mail_sender. Lifetime: `on` outlives it.
class smtp_sender final : public mail_sender {
public:
    /// Throws ise::error (invalid_argument) for a server that is none.
    smtp_sender(curl_transfers& on, smtp_options options);

    ise::task<ise::result<void>> send(mail_message what) override;

private:
    class dialogue;

    curl_transfers& on_;
    smtp_options options_;
};

} // namespace atirma
