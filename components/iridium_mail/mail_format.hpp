#pragma once
#include <components/mail/mail.hpp>

#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

// The mails of the Iridium short-burst-data gateway. Pure.
namespace atirma::iridium_mail {

inline constexpr std::size_t max_mt_bytes = 270;                                 ///< what a 9602 takes
inline constexpr std::size_t max_mt_imeis = 4;                                   ///< units that one mail may be for
inline constexpr std::size_t max_mo_bytes = 1960;                                ///< of any unit; a 9602 sends 340
inline constexpr std::string_view gateway_sender = "sbdservice@sbd.iridium.com"; ///< who mails to us
inline constexpr std::string_view gateway_address = "data@sbd.iridium.com";      ///< who takes messages for units

/// How a session went, as the gateway numbers it.
enum class session_status : std::uint8_t {
    ok = 0,
    mt_too_large = 1,  ///< the message from the unit is whole all the same
    location_poor = 2, ///< likewise
    timed_out = 10,
    mo_too_large = 12,
    incomplete = 13,
    protocol_error = 14,
    denied = 15,
};
/// "transfer ok", …; "status 40" is "unknown".
std::string_view name_of(session_status status) noexcept;
/// Whether what the unit had to send has arrived whole.
constexpr bool has_arrived(session_status status) noexcept { return static_cast<std::uint8_t>(status) <= 2; }

/// One session of a unit, as the gateway told it by mail. A mailbox check has no payload.
struct mo_session {
    std::string imei;        ///< 15 digits
    std::uint16_t momsn = 0; ///< grows with each session, wraps
    std::uint16_t mtmsn = 0; ///< of the message that the unit received; 0: none
    std::chrono::sys_seconds session_at{};
    session_status status = session_status::ok; ///< may be a number without a name
    std::uint32_t size = 0;                     ///< bytes of the message, as the gateway says
    std::optional<double> latitude_deg;         ///< absent where geo-data is off
    std::optional<double> longitude_deg;
    std::optional<double> cep_km;
    std::vector<std::byte> payload; ///< `size` bytes, or none where the transfer failed
    bool operator==(const mo_session&) const = default;
};

/// What the gateway did with a message for a unit.
struct disposition {
    bool queued = false;
    std::string imei;                            ///< empty where an error does not say it
    std::string attachment;                      ///< the name that the message had; may be empty
    std::optional<std::uint16_t> mtmsn;          ///< given when it was queued
    std::optional<std::uint32_t> queue_position; ///< 1: the next one
    std::string reason;                          ///< why it was not queued, in the gateway's words
    bool operator==(const disposition&) const = default;
};

using gateway_mail = std::variant<mo_session, disposition>;

/// A mail of the gateway. Errors: unauthorized (another sender than `from`), malformed (it says what it cannot be:
/// which field, which attachment, a message of another size than stated), too_large.
ise::result<gateway_mail> read_gateway_mail(const mail_message& mail, std::string_view from = gateway_sender);

/// Whether the mail server `authserv` found the sender of a mail to be of `domain`. Of `results` (see mail_message) the
/// first of that server counts: it passes by DMARC, by a DKIM signature of the domain or one above it, or by SPF of the
/// domain. Error: unauthorized, with what it says.
ise::result<void> check_authentication(const std::vector<std::string>& results, std::string_view authserv,
                                       std::string_view domain);

/// A message for units: its attachment's name comes back in the disposition.
struct mt_message {
    std::string name; ///< "c17.sbd": letters, digits, '_', '-', '.', at most 80
    std::vector<std::byte> payload;
    bool operator==(const mt_message&) const = default;
};

/// The mail that asks the gateway to queue `messages` for each of `imeis`. Errors: invalid_argument (no or too many
/// units, one twice, an IMEI that is none, a message that is empty, too long, or badly named).
ise::result<mail_message> make_mt_mail(const std::string& from, const std::vector<std::string>& imeis,
                                       const std::vector<mt_message>& messages, std::string_view to = gateway_address);

/// 15 digits.
bool is_imei(std::string_view text) noexcept;

// The gateway's side, for emulations and tests.

struct mt_order {
    std::vector<std::string> imeis;
    std::vector<mt_message> messages;
};
/// Errors: malformed, with what the gateway would answer.
ise::result<mt_order> read_mt_mail(const mail_message& mail);
mail_message make_mo_mail(const mo_session& session, const std::string& to, std::string_view from = gateway_sender);
mail_message make_disposition_mail(const disposition& what, const std::string& to,
                                   std::string_view from = gateway_sender);

} // namespace atirma::iridium_mail
