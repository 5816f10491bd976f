#pragma once
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/core/time.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace atirma {

struct mail_attachment {
    std::string name; ///< "Ausland_000023.sbd"
    std::vector<std::byte> content;
};

/// A mail, decoded: texts are UTF-8, attachments are what they were before base64.
struct mail_message {
    std::string from; ///< an address: "data@sbd.iridium.com"
    std::vector<std::string> to;
    std::string subject;
    std::string text;
    std::vector<mail_attachment> attachments;
    /// What the servers on the way found out about the sender: each Authentication-Results (RFC 8601), the last
    /// server's first. Read, never written.
    std::vector<std::string> authentication_results;
};

/// A mail in a mailbox.
struct stored_mail {
    std::uint32_t uid = 0; ///< of the mailbox, never given twice
    mail_message message;
};

/// A mailbox that programs write to and nobody else reads: IMAP in the real world (components/curl), memory in the
/// virtual one. Lifetime: outlives its tasks. Used on one loop, one task at a time.
class mailbox {
public:
    virtual ~mailbox() = default;

    /// The oldest mails that are not done, at most `most`; one that cannot be read as a mail comes with an empty sender
    /// and what was wrong as its text. Errors: unreachable, unauthorized, timed_out, io_failed (the server refuses or
    /// breaks the protocol), each to be tried again later. Cancellation: terminal, nothing is marked.
    virtual ise::task<ise::result<std::vector<stored_mail>>> fetch(std::size_t most) = 0;
    /// A mail that `fetch` will not give again: called once its content is safe. Errors as `fetch`: then it may come
    /// again.
    virtual ise::task<ise::result<void>> done(std::uint32_t uid) = 0;
    /// Returns when there may be mail that the last `fetch` did not see, after `at_most` in any case. Errors as
    /// `fetch`.
    virtual ise::task<ise::result<void>> wait(ise::duration at_most) = 0;
};

/// Sends mails: SMTP in the real world, memory in the virtual one.
/// Lifetime: outlives its tasks. Used on one loop.
class mail_sender {
public:
    virtual ~mail_sender() = default;

    /// Success: a server has taken the mail on. Errors: invalid_argument (no such address), refused (the server says
    /// never: its reason), unreachable (also: not now), unauthorized, timed_out, peer_lost; `executed()` says whether
    /// it may have been taken. Cancellation: terminal, it may have been taken.
    virtual ise::task<ise::result<void>> send(mail_message what) = 0;
};

} // namespace atirma
