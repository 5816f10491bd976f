#pragma once
#include <components/iridium/message.hpp>

#include <string>
#include <string_view>

// What host and 9602 say to each other beside the bare commands.
namespace atirma::iridium {

/// `+SBDIX: 0, 23, 1, 4, 12, 0`: how a session went.
struct sbdix {
    int mo_status = 0;
    int momsn = 0;
    int mt_status = 0; ///< 0 none waits, 1 one was received, 2 the mailbox could not be looked at
    int mtmsn = 0;
    int mt_length = 0;
    int mt_queued = 0; ///< that wait at the gateway still
    bool mo_arrived() const noexcept { return mo_status >= 0 && mo_status <= 4; }
    bool operator==(const sbdix&) const = default;
};
/// Error: malformed.
ise::result<sbdix> parse_sbdix(std::string_view line);
std::string encode_sbdix(const sbdix& outcome);

/// "32": "no network service".
std::string_view explain_mo_status(int status) noexcept;

/// What follows binary data on the line: the sum of its bytes, 16 bits.
std::uint16_t line_sum(ise::bytes_view data) noexcept;

} // namespace atirma::iridium
