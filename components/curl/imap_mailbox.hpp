#pragma once
#include <components/curl/curl_transfers.hpp>
#include <components/mail/mail.hpp>

#include <optional>
#include <set>

namespace atirma {

/// What becomes of a mail that is done.
enum class imap_done : std::uint8_t {
    seen,   ///< stays, marked as seen: mails that anybody has read are not fetched
    moved,  ///< goes to another folder, which is made where it is missing
    removed ///< is deleted for good
};

struct imap_options {
    std::string server; ///< "imaps://mail.example" (993), or "imap://mail.example" (143), which then starts TLS
    std::string user, password;
    std::string folder = "INBOX";
    imap_done when_done = imap_done::seen;
    std::string done_folder = "Done"; ///< for `moved`
    std::string ca_file;              ///< PEM file of the authorities to trust; empty: those of the system
    bool clear_text = false;          ///< imap:// without TLS where the server has none: on the own host only
    std::size_t max_mail_bytes = 1 << 20; ///< a larger one comes as one that cannot be read
    ise::duration within = std::chrono::seconds(60);      ///< to connect and log in, and for each command
    ise::duration poll_period = std::chrono::seconds(60); ///< where the server has no IDLE
};

class imap_session;

/// A folder of an IMAP server. Keeps one session and makes a new one when it needs it; mails are fetched without
/// marking them. Errors: see mailbox. Lifetime: `on` outlives it.
class imap_mailbox final : public mailbox {
public:
    /// Throws ise::error (invalid_argument) for a server or a folder that is none.
    imap_mailbox(curl_transfers& on, imap_options options);
    ~imap_mailbox() override;

    ise::task<ise::result<std::vector<stored_mail>>> fetch(std::size_t most) override;
    ise::task<ise::result<void>> done(std::uint32_t uid) override;
    ise::task<ise::result<void>> wait(ise::duration at_most) override;

private:
    ise::task<ise::result<void>> connected();
    ise::task<ise::result<std::vector<stored_mail>>> fetch_now(std::size_t most);
    ise::task<ise::result<std::optional<stored_mail>>> fetch_one(std::uint32_t uid);
    ise::task<ise::result<void>> mark(std::uint32_t uid);
    ise::task<ise::result<void>> put_away(std::uint32_t uid);
    ise::task<ise::result<void>> watch(ise::duration at_most);

    curl_transfers& on_;
    imap_options options_;
    std::string folder_, done_folder_; // quoted
    std::unique_ptr<imap_session> session_;
    std::optional<std::uint32_t> validity_; // of the uids that were given out
};

} // namespace atirma
