#pragma once
#include <components/iridium/message.hpp>

#include <string>
#include <string_view>

// The web services of RockBLOCK: the push of MO messages, and the submission of MT messages.
namespace atirma::iridium {

/// What the gateway posts to a webhook.
struct mo_delivery {
    mo_message message;
    std::uint32_t serial = 0;  ///< of the device; 0: was not told
    std::string device_type;   ///< "ROCKBLOCK"
    std::string jwt;           ///< empty: none came along
    std::string transmit_time; ///< as it stood there
};

/// A form, or JSON where the body begins with `{`. Required: imei, momsn, transmit_time, data (may be empty).
/// Errors: malformed, naming the field and what is wrong; too_large (more than a 9602 sends).
ise::result<mo_delivery> parse_mo_delivery(std::string_view body);
std::string encode_mo_form(const mo_delivery& what);
std::string encode_mo_json(const mo_delivery& what);

/// What `POST /rockblock/MT` is given.
struct mt_submission {
    std::string imei;
    std::string username;
    std::string password;
    std::string data;   ///< hex
    bool flush = false; ///< first drops what waits for the modem
};
std::string encode_mt_submission(const mt_submission& what);
/// Of a form (body or query string). Error: malformed (no form at all); what is missing is empty.
ise::result<mt_submission> parse_mt_submission(std::string_view body);

/// Why an MT submission failed. The numbers are RockBLOCK's.
enum class mt_failure : int {
    bad_login = 10,
    no_such_imei = 11,
    no_line_rental = 12,
    no_credit = 13,
    bad_hex = 14,
    too_long = 15,
    no_data = 16,
    system_error = 99,
};
/// "the account has no credit left: buy some"; "an unknown failure" for other numbers.
std::string_view explain_mt_failure(int code) noexcept;
/// Whether the same submission may succeed later without anybody doing anything.
bool mt_failure_passes(int code) noexcept;

struct mt_reply {
    bool accepted = false;
    std::string reference; ///< of the gateway, where accepted
    int code = 0;          ///< else
    std::string text;      ///< the gateway's words
    bool operator==(const mt_reply&) const = default;
};
/// `OK,4114651` or `FAILED,10,Invalid login credentials`. Error: malformed.
ise::result<mt_reply> parse_mt_reply(std::string_view body);
std::string encode_mt_reply(const mt_reply& reply);

} // namespace atirma::iridium
