#pragma once
#include <ise/core/time.hpp>

#include <cstdint>
#include <string>

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
    std::string done_folder = "Done";     ///< for `moved`
    std::string ca_file;                  ///< PEM file of the authorities to trust; empty: those of the system
    bool clear_text = false;              ///< imap:// without TLS where the server has none: on the own host only
    std::size_t max_mail_bytes = 1 << 20; ///< a larger one comes as one that cannot be read
    ise::duration within = std::chrono::seconds(60);      ///< to connect and log in, and for each command
    ise::duration poll_period = std::chrono::seconds(60); ///< where the server has no IDLE
};

} // namespace atirma
