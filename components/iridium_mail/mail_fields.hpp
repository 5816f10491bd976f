#pragma once
#include <ise/core/result.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

// What stands in the text of the gateway's mails. Pure.
namespace atirma::iridium_mail {

/// A line "name: value" or "name = value", blanks around both cut off.
struct mail_field {
    std::string name; ///< in lower case
    std::string value;
};

/// The fields of a text, in order; other lines are passed over.
std::vector<mail_field> fields_of(std::string_view text);

/// Blanks and line ends cut off at both ends.
std::string_view trimmed(std::string_view text) noexcept;
std::string lower(std::string_view text);
bool same_text(std::string_view a, std::string_view b) noexcept; ///< whatever their case, in ASCII

/// Digits only, not above `most`.
std::optional<std::uint32_t> whole_number(std::string_view text, std::uint32_t most) noexcept;
/// A decimal number such as "-59.372463" whose absolute value is not above `most`.
std::optional<double> decimal(std::string_view text, double most) noexcept;

/// "Tue Aug 13 16:51:04 2002", UTC.
std::optional<std::chrono::sys_seconds> session_time(std::string_view text) noexcept;
std::string session_time_text(std::chrono::sys_seconds at);

/// The first run of exactly 15 digits.
std::optional<std::string> imei_in(std::string_view text);

} // namespace atirma::iridium_mail
