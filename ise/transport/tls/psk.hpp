#pragma once
#include <ise/core/error.hpp>
#include <ise/core/result.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

struct ssl_st; // of OpenSSL
struct ssl_ctx_st;

/// Sessions that are sealed by the shared key: TLS 1.3 with an external PSK and an ephemeral key exchange (FORMAT.md,
/// section 17).
namespace ise::net::tls {

using psk_secret = std::array<std::uint8_t, 32>;

/// What sessions are made with. Lifetime: `secret` outlives the context and the sessions made with it.
/// Errors: errc::io_failed, where OpenSSL lacks what is needed.
result<std::shared_ptr<ssl_ctx_st>> psk_context(const psk_secret& secret);

/// The cipher suites of sealed sessions, the one first that is fast on this processor. False: OpenSSL noted why not.
bool use_sealing_ciphers(ssl_st* session) noexcept;

/// What errors of OpenSSL mean for one kind of session.
struct error_meanings {
    /// The peer refused the session. `scheme`: of endpoints with certificates over the same carrier.
    failure (*of_alert)(int alert, std::string_view scheme);
    /// This side did, by OpenSSL's reason; empty: nothing special.
    std::optional<failure> (*of_reason)(int code, std::string_view scheme);
    std::string_view otherwise; ///< begins the text for everything else
};
/// What the first error that OpenSSL noted on this thread means for the session. Clears the notes.
failure first_error_noted(const error_meanings& here, std::string_view scheme);
/// The same for a session sealed by the shared key.
failure psk_failure_noted(std::string_view scheme);

/// The alerts by which a listener without sealed sessions answers one that asks for them.
enum class refusal : std::uint8_t {
    old_scheme = 71, ///< insufficient_security: it demands the proof of the old scheme
    unable = 80,     ///< internal_error: its credentials cannot be used
    no_key = 115,    ///< unknown_psk_identity: it has no key
};
/// The record of TLS with that alert.
std::array<std::byte, 7> record_of(refusal why) noexcept;
/// Whether a stream that begins so asks for TLS; empty: that takes more bytes. No frame of ISE begins so.
std::optional<bool> asks_for_tls(std::span<const std::byte> begin) noexcept;

/// Why who asks for a seal is refused, where none is known here; `old_scheme`: the key is proved by the old scheme.
std::string_view why_no_seal(bool old_scheme) noexcept;
/// Why who begins a session so, with a hello and without a seal, is refused.
std::string_view why_no_session(std::string_view begin) noexcept;

} // namespace ise::net::tls
