#include <components/iridium/message.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma::iridium {

ise::result<void> check_imei(std::string_view imei) {
    bool good = imei.size() == 15 && std::all_of(imei.begin(), imei.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (good) return {};
    std::string shown;
    for (char c : imei.substr(0, 20)) shown += c >= ' ' && c < 127 ? c : '?';
    return ise::failure(ise::errc::malformed, fmt::format("an IMEI has 15 digits; '{}' is none", shown));
}

std::string_view explain_session_status(unsigned status) noexcept {
    switch (status) {
        case 0: return "transfer ok";
        case 1: return "transfer ok; the MT message at the gateway is too large for the modem";
        case 2: return "transfer ok; the location was not accepted";
        case 10: return "timeout: the session did not end in time";
        case 12: return "the MO message is too large for the gateway";
        case 13: return "incomplete: the radio link was lost";
        case 14: return "protocol error of the modem";
        case 15: return "access denied to the modem";
        default: return "no known session status";
    }
}

} // namespace atirma::iridium
