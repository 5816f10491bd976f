#pragma once
#include <components/curl/curl_transfers.hpp>
#include <components/curl/imap_options.hpp>
#include <components/mail/mail.hpp>

#include <memory>
#include <optional>
#include <vector>

namespace atirma {

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
