// What is known of TLS without OpenSSL.
#include <ise/transport/tls/psk.hpp>

namespace ise::net::tls {

std::array<std::byte, 7> record_of(refusal why) noexcept {
    constexpr std::byte alert{21}, major{3}, minor{3}, fatal{2};
    return {alert, major, minor, std::byte{0}, std::byte{2}, fatal, static_cast<std::byte>(why)};
}

// A record of TLS: the kind (22, a handshake), a version (3, 1…4), a length. A frame of a greeting has a length below
// 65,536 there, so its third byte is 0.
std::optional<bool> asks_for_tls(std::span<const std::byte> begin) noexcept {
    if (!begin.empty() && begin[0] != std::byte{22}) return false;
    if (begin.size() > 1 && begin[1] != std::byte{3}) return false;
    if (begin.size() < 3) return std::nullopt;
    return begin[2] != std::byte{0};
}

std::string_view why_no_seal(bool old_scheme) noexcept {
    if (old_scheme)
        return "it seals its sessions with the shared key, and this side proves its key by the old scheme: start both "
               "with "
               "ISE_KEY_LEGACY=1, or neither";
    return "it seals its sessions with a shared key, and this side has no key (--key FILE or ISE_KEY); or one side has "
           "tls://, the other not";
}

std::string_view why_no_session(std::string_view begin) noexcept {
    constexpr std::string_view old_scheme = "hmac-sha256"; // in its hello
    if (begin.find(old_scheme) != begin.npos)
        return "sessions with the shared key are sealed here, and it proves it by the old scheme, as an earlier "
               "version or "
               "with --key-legacy does: start both sides with ISE_KEY_LEGACY=1, or neither";
    return "a shared key is demanded here, and none was offered: give the key's file with --key FILE or ISE_KEY";
}

} // namespace ise::net::tls
