#pragma once
#include <components/mail/mail.hpp>

#include <ise/core/loop.hpp>

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>

namespace atirma {

/// How the server in memory behaves; may be changed at any time.
struct memory_mail_options {
    ise::duration answer_after = std::chrono::milliseconds(50); ///< of each operation, on the clock of whoever asks
    ise::duration transit{}; ///< between the taking of a mail and its delivery; needs `later`
    /// Runs an action after a time: `[&](auto t, auto f) { world.after(t, f); }`. The mails under way belong to the
    /// server, not to the process that sent them. Without it mails are delivered as soon as they are taken.
    std::function<void(ise::duration, std::function<void()>)> later;
    bool reachable = true;                      ///< false: everything ends with unreachable
    bool accepts_logins = true;                 ///< false: with unauthorized
    std::map<std::string, std::string> refused; ///< addresses that take no mail, each with the server's reason
    std::size_t max_mails = 10'000;             ///< in one folder; beyond them it is full and refuses
};

/// A mail server in memory, for the virtual world: what it has taken survives the processes that use it. One folder an
/// address, made by its first mail. One thread; outlives what it opened and must not move.
class memory_mail {
public:
    explicit memory_mail(memory_mail_options options = memory_mail_options());
    ~memory_mail();
    memory_mail(const memory_mail&) = delete;
    memory_mail& operator=(const memory_mail&) = delete;

    memory_mail_options options;

    /// The folder of an address, for a component on this loop.
    std::unique_ptr<mailbox> open_mailbox(ise::loop& on, std::string address);
    /// Sends to the folders of this server; addresses are compared without regard to case.
    std::unique_ptr<mail_sender> open_sender(ise::loop& on);

    /// Puts a mail into the folders of all its receivers, at once and whatever the options say. False where one is
    /// full.
    bool deliver(const mail_message& what);
    /// What `fetch` would give of an address, oldest first.
    std::vector<stored_mail> waiting(const std::string& address) const;
    std::uint64_t delivered() const noexcept { return delivered_; }
    std::uint64_t done() const noexcept { return done_; }

private:
    class box;
    class sender;
    struct folder {
        std::uint32_t next_uid = 1;
        std::map<std::uint32_t, mail_message> mails; // not done
        std::set<box*> open;
    };

    std::optional<ise::failure> trouble() const;
    folder& folder_of(const std::string& address);
    std::optional<ise::failure> take(const mail_message& what);

    std::map<std::string, folder> folders_;
    std::uint64_t delivered_ = 0;
    std::uint64_t done_ = 0;
    std::shared_ptr<memory_mail*> self_; // mails under way look at it
};

} // namespace atirma
