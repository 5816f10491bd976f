#pragma once
#include <components/mail/mail.hpp>

#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
#include <string>
#include <string_view>

namespace atirma {

/// What a mail may bring along; more is refused.
struct mime_limits {
    std::size_t max_bytes = 1 << 20; ///< of the whole mail, as it stands in the mailbox
    std::size_t max_parts = 64;
};

/// What a mail bears beside its content; drawn by whoever sends it.
struct mail_stamp {
    ise::wall_time sent_at{};
    std::uint64_t random = 0; ///< tells its Message-ID and boundary from all others
};

/// A mail as a server keeps it (RFC 5322 and MIME) → its content. Nothing is made up: a mail without a sender, one that
/// ends in the middle, an attachment whose base64 is broken are refused with `malformed`, too much of it with
/// `too_large`.
ise::result<mail_message> read_mail(std::string_view raw, const mime_limits& limits = mime_limits());

/// The same the other way: multipart/mixed with a UTF-8 text and base64 attachments, lines ending in CR LF, none longer
/// than 998 bytes. Errors: invalid_argument (no such address, nobody to send it to, texts that are no UTF-8).
ise::result<std::string> write_mail(const mail_message& what, const mail_stamp& stamp);

/// Whether it can stand in a mail and in SMTP as it is: "data@sbd.iridium.com", in ASCII, without a display name.
bool is_mail_address(std::string_view text) noexcept;

} // namespace atirma
