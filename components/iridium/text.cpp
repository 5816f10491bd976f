#include <components/iridium/text.hpp>

#include <components/boat/hex_digit.hpp>

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

namespace atirma::iridium {
namespace {

constexpr std::size_t max_fields = 64;
constexpr std::string_view base64url_digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

ise::failure bad_text(std::string what) { return ise::failure(ise::errc::malformed, std::move(what)); }

ise::result<std::string> percent_decoded(std::string_view text) {
    std::string out;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '+') {
            out += ' ';
        } else if (text[i] != '%') {
            out += text[i];
        } else {
            int high = i + 2 < text.size() ? hex_digit(text[i + 1]) : -1;
            int low = i + 2 < text.size() ? hex_digit(text[i + 2]) : -1;
            if (high < 0 || low < 0) return bad_text("a % in a form that no two hex digits follow");
            out += static_cast<char>(high * 16 + low);
            i += 2;
        }
    }
    return out;
}

std::string percent_encoded(std::string_view text) {
    std::string out;
    for (char c : text) {
        bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' ||
                     c == '_' || c == '.' || c == '~';
        if (plain) out += c;
        else out += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
    return out;
}

/// `count` digits of `text` from `at`; -1 if one is none.
int digits(std::string_view text, std::size_t at, std::size_t count) noexcept {
    int value = 0;
    for (std::size_t i = at; i < at + count; ++i) {
        if (i >= text.size() || text[i] < '0' || text[i] > '9') return -1;
        value = value * 10 + (text[i] - '0');
    }
    return value;
}

} // namespace

std::string to_hex(ise::bytes_view raw) {
    std::string out;
    out.reserve(raw.size() * 2);
    for (auto b : raw) {
        constexpr std::string_view digits_of = "0123456789abcdef";
        out += digits_of[std::to_integer<unsigned>(b) >> 4];
        out += digits_of[std::to_integer<unsigned>(b) & 15];
    }
    return out;
}

ise::result<ise::bytes> from_hex(std::string_view text, std::size_t most) {
    if (text.size() % 2 != 0) return bad_text(fmt::format("{} hex digits are no whole bytes", text.size()));
    if (text.size() / 2 > most)
        return ise::failure(ise::errc::too_large, fmt::format("{} bytes, {} at most", text.size() / 2, most));
    ise::bytes out;
    out.reserve(text.size() / 2);
    for (std::size_t i = 0; i < text.size(); i += 2) {
        int high = hex_digit(text[i]), low = hex_digit(text[i + 1]);
        if (high < 0 || low < 0) return bad_text(fmt::format("no hex digit at place {}", high < 0 ? i : i + 1));
        out.push_back(static_cast<std::byte>(high * 16 + low));
    }
    return out;
}

ise::result<std::string> from_base64url(std::string_view text) {
    while (!text.empty() && text.back() == '=') text.remove_suffix(1);
    if (text.size() % 4 == 1) return bad_text("base64url of an impossible length");
    std::string out;
    std::uint32_t bits = 0;
    unsigned have = 0;
    for (char c : text) {
        auto value = base64url_digits.find(c);
        if (value == std::string_view::npos) return bad_text("a character that base64url has not");
        bits = (bits << 6) | static_cast<std::uint32_t>(value);
        have += 6;
        if (have < 8) continue;
        have -= 8;
        out += static_cast<char>((bits >> have) & 0xFF);
    }
    return out;
}

std::string to_base64url(std::string_view raw) {
    std::string out;
    std::uint32_t bits = 0;
    unsigned have = 0;
    for (char c : raw) {
        bits = (bits << 8) | static_cast<unsigned char>(c);
        for (have += 8; have >= 6; have -= 6) out += base64url_digits[(bits >> (have - 6)) & 63];
    }
    if (have > 0) out += base64url_digits[(bits << (6 - have)) & 63];
    return out;
}

ise::result<form> parse_form(std::string_view body) {
    form fields;
    for (std::size_t count = 0; !body.empty(); ++count) {
        if (count == max_fields)
            return ise::failure(ise::errc::too_large, fmt::format("a form of more than {} fields", max_fields));
        auto end = body.find('&');
        auto field = body.substr(0, end);
        body.remove_prefix(end == std::string_view::npos ? body.size() : end + 1);
        if (field.empty()) continue;
        auto equals = field.find('=');
        auto name = percent_decoded(field.substr(0, equals));
        auto value = percent_decoded(equals == std::string_view::npos ? std::string_view() : field.substr(equals + 1));
        if (!name) return name.error();
        if (!value) return value.error();
        fields[std::move(*name)] = std::move(*value);
    }
    return fields;
}

std::string encode_form(std::span<const std::pair<std::string, std::string>> fields) {
    std::string out;
    for (const auto& [name, value] : fields) {
        if (!out.empty()) out += '&';
        out += percent_encoded(name) + '=' + percent_encoded(value);
    }
    return out;
}

ise::result<std::chrono::sys_seconds> parse_transmit_time(std::string_view text) {
    using namespace std::chrono;
    auto wrong = [&] {
        return bad_text(
            fmt::format("'{}' is not a time: YY-MM-DD HH:MM:SS or YYYY-MM-DDTHH:MM:SSZ, UTC", text.substr(0, 40)));
    };
    bool iso = text.size() >= 20 && text[10] == 'T';
    std::size_t at = iso ? 4 : 2;
    int year_number = iso ? digits(text, 0, 4) : digits(text, 0, 2);
    if (year_number < 0) return wrong();
    if (!iso) year_number += 2000;
    auto tail = text.substr(std::min(at, text.size()));
    // "-MM-DDxHH:MM:SS" and, in ISO, perhaps a fraction of a second, which is dropped.
    if (tail.size() < 15 || tail[0] != '-' || tail[3] != '-' || tail[6] != (iso ? 'T' : ' ') || tail[9] != ':' ||
        tail[12] != ':')
        return wrong();
    int month_number = digits(tail, 1, 2), day_number = digits(tail, 4, 2);
    int hour = digits(tail, 7, 2), minute = digits(tail, 10, 2), second = digits(tail, 13, 2);
    auto rest = tail.substr(15);
    if (iso) {
        if (rest.empty() || rest.back() != 'Z') return wrong();
        rest.remove_suffix(1);
        if (!rest.empty() &&
            (rest.size() < 2 || rest.size() > 10 || rest[0] != '.' || digits(rest, 1, rest.size() - 1) < 0))
            return wrong();
    } else if (!rest.empty()) {
        return wrong();
    }
    if (month_number < 0 || day_number < 0 || hour < 0 || minute < 0 || second < 0 || hour > 23 || minute > 59 ||
        second > 60)
        return wrong();
    year_month_day date{year(year_number), month(static_cast<unsigned>(month_number)),
                        day(static_cast<unsigned>(day_number))};
    if (!date.ok()) return wrong();
    return sys_seconds(sys_days(date)) + hours(hour) + minutes(minute) + seconds(second);
}

std::string format_transmit_time(std::chrono::sys_seconds at) {
    using namespace std::chrono;
    auto midnight = floor<days>(at);
    year_month_day date(midnight);
    hh_mm_ss time(at - midnight);
    return fmt::format("{:02}-{:02}-{:02} {:02}:{:02}:{:02}", static_cast<int>(date.year()) % 100,
                       static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()), time.hours().count(),
                       time.minutes().count(), time.seconds().count());
}

ise::result<std::int64_t> parse_integer(std::string_view what, std::string_view text, std::int64_t least,
                                        std::int64_t most) {
    std::int64_t value = 0;
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (problem != std::errc() || end != text.data() + text.size() || value < least || value > most)
        return bad_text(fmt::format("{} is {} to {}, not '{}'", what, least, most, text.substr(0, 40)));
    return value;
}

ise::result<double> parse_real(std::string_view what, std::string_view text, double least, double most) {
    double value = 0;
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (problem != std::errc() || end != text.data() + text.size() || !(value >= least && value <= most))
        return bad_text(fmt::format("{} is {:g} to {:g}, not '{}'", what, least, most, text.substr(0, 40)));
    return value;
}

} // namespace atirma::iridium
