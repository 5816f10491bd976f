#include <components/iridium/at.hpp>

#include <components/iridium/text.hpp>

#include <fmt/format.h>

namespace atirma::iridium {

ise::result<sbdix> parse_sbdix(std::string_view line) {
    auto colon = line.find(':');
    auto name = line.substr(0, colon);
    if (colon == std::string_view::npos || (name != "+SBDIX" && name != "+SBDIXA"))
        return ise::failure(ise::errc::malformed, fmt::format("'{}' is not a result of a session", line.substr(0, 60)));
    line.remove_prefix(colon + 1);
    sbdix out;
    int* into[] = {&out.mo_status, &out.momsn, &out.mt_status, &out.mtmsn, &out.mt_length, &out.mt_queued};
    for (std::size_t i = 0; i < std::size(into); ++i) {
        auto comma = line.find(',');
        if ((comma == std::string_view::npos) != (i + 1 == std::size(into)))
            return ise::failure(ise::errc::malformed, "a session's result has six numbers");
        auto text = line.substr(0, comma);
        while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
        while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
        auto number = parse_integer("a number of +SBDIX", text, 0, 65535);
        if (!number) return number.error();
        *into[i] = static_cast<int>(*number);
        if (comma != std::string_view::npos) line.remove_prefix(comma + 1);
    }
    return out;
}

std::string encode_sbdix(const sbdix& info) {
    return fmt::format("+SBDIX: {}, {}, {}, {}, {}, {}", info.mo_status, info.momsn, info.mt_status, info.mtmsn,
                       info.mt_length, info.mt_queued);
}

std::string_view explain_mo_status(int status) noexcept {
    switch (status) {
        case 0: return "sent";
        case 1: return "sent; the MT message at the gateway is too large for the modem";
        case 2: return "sent; the location was not accepted";
        case 3:
        case 4: return "sent";
        case 10: return "the gateway did not end the call in time";
        case 11: return "the MO queue at the gateway is full";
        case 12: return "the message has too many segments";
        case 13: return "the session did not complete";
        case 14: return "a segment of invalid size";
        case 15: return "access denied: is the modem activated?";
        case 16: return "the modem is locked";
        case 17: return "the gateway does not answer";
        case 18: return "the radio link was lost";
        case 19: return "the link failed: protocol error";
        case 32: return "no network service: is the sky free?";
        case 33: return "antenna fault";
        case 34: return "the radio is disabled";
        case 35: return "the modem is busy";
        case 36: return "try later: three minutes since the last registration";
        case 37: return "SBD is temporarily disabled";
        case 38: return "try later: traffic management";
        case 64: return "band violation";
        case 65: return "PLL lock failure";
        default: return "it failed in a way that is not documented";
    }
}

std::uint16_t line_sum(ise::bytes_view data) noexcept {
    unsigned sum = 0;
    for (auto b : data) sum += std::to_integer<unsigned>(b);
    return static_cast<std::uint16_t>(sum & 0xFFFF);
}

} // namespace atirma::iridium
