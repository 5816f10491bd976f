#include <ise/core/readable.hpp>
#include <ise/core/time_text.hpp>
#include <ise/packet/detail/text_forms.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>

namespace ise::detail {

std::string_view reason_of(const std::exception& why) noexcept {
    std::string_view what = why.what();
    if (std::size_t end = what.find("] "); what.starts_with('[') && end != what.npos) what.remove_prefix(end + 2);
    return what;
}

namespace {
constexpr std::string_view digits64 = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

// The length of the UTF-8 sequence at the start, 0 where there is none.
std::size_t sequence_length(std::string_view text) noexcept {
    auto at = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    unsigned char first = at(0);
    if (first < 0x80) return 1;
    std::size_t length = first >= 0xc2 && first <= 0xdf   ? 2
                         : (first & 0xf0) == 0xe0         ? 3
                         : first >= 0xf0 && first <= 0xf4 ? 4
                                                          : 0;
    if (length == 0 || text.size() < length) return 0;
    for (std::size_t i = 1; i < length; ++i)
        if ((at(i) & 0xc0) != 0x80) return 0;
    if ((first == 0xe0 && at(1) < 0xa0) || (first == 0xed && at(1) > 0x9f) || (first == 0xf0 && at(1) < 0x90) ||
        (first == 0xf4 && at(1) > 0x8f))
        return 0; // overlong, surrogate, beyond U+10FFFF
    return length;
}

template <class T>
void append_number(std::string& out, T value) {
    if (std::isnan(value)) out += "\"NaN\"";
    else if (std::isinf(value)) out += value > 0 ? "\"Infinity\"" : "\"-Infinity\"";
    else if (value == 0 && std::signbit(value)) out += "-0.0"; // without a point it is the integer 0
    else out += fmt::format("{}", value);
}

// Decimal places of a period of 1/10^n seconds.
std::optional<int> decimal_places(const type_description& type) noexcept {
    if (type.period_num != 1) return std::nullopt;
    std::int64_t den = type.period_den;
    int places = 0;
    while (den % 10 == 0) {
        den /= 10;
        ++places;
    }
    return den == 1 ? std::optional(places) : std::nullopt;
}

std::int64_t floor_div(std::int64_t a, std::int64_t b) noexcept { return a / b - (a % b < 0 ? 1 : 0); }

std::string decimal_seconds(std::int64_t ticks, std::int64_t den, int places) {
    bool negative = ticks < 0;
    std::uint64_t size = negative ? 0 - static_cast<std::uint64_t>(ticks) : static_cast<std::uint64_t>(ticks);
    auto d = static_cast<std::uint64_t>(den);
    std::string text = fmt::format("{}{}", negative ? "-" : "", size / d);
    if (size % d == 0) return text;
    std::string fraction = fmt::format("{:0{}}", size % d, places);
    fraction.erase(fraction.find_last_not_of('0') + 1);
    return text + "." + fraction;
}

// whole seconds and a fraction "123" as ticks.
std::optional<std::int64_t> combine(std::int64_t seconds, std::string_view fraction, bool negative, std::int64_t den,
                                    int places) {
    if (fraction.size() > static_cast<std::size_t>(places)) return std::nullopt; // finer than the type
    std::int64_t part = 0;
    for (int i = 0; i < places; ++i) {
        auto index = static_cast<std::size_t>(i);
        char c = index < fraction.size() ? fraction[index] : '0';
        if (c < '0' || c > '9') return std::nullopt;
        part = part * 10 + (c - '0');
    }
    auto rest = negative ? -part : part;
    // Of one sign: else the seconds alone may lie outside where the sum does not.
    if (seconds < 0 && rest > 0) {
        ++seconds;
        rest -= den;
    } else if (seconds > 0 && rest < 0) {
        --seconds;
        rest += den;
    }
    std::int64_t ticks = 0;
    if (__builtin_mul_overflow(seconds, den, &ticks) || __builtin_add_overflow(ticks, rest, &ticks))
        return std::nullopt;
    return ticks;
}

template <class T>
bool take_number(std::string_view& text, T& value) {
    auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (failed != std::errc()) return false;
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    return true;
}

bool take_digits(std::string_view& text, std::size_t count, int& value) {
    if (text.size() < count) return false;
    value = 0;
    for (std::size_t i = 0; i < count; ++i) {
        if (text[i] < '0' || text[i] > '9') return false;
        value = value * 10 + (text[i] - '0');
    }
    text.remove_prefix(count);
    return true;
}

bool take(std::string_view& text, char c) {
    if (text.empty() || text[0] != c) return false;
    text.remove_prefix(1);
    return true;
}

std::optional<std::int64_t> from_iso(std::string_view text, std::int64_t den, int places) {
    namespace chrono = std::chrono;
    int year = 0, month = 0, day = 0, hour = 0, minute = 0, second = 0;
    if (!take_digits(text, 4, year) || !take(text, '-') || !take_digits(text, 2, month) || !take(text, '-') ||
        !take_digits(text, 2, day) || !(take(text, 'T') || take(text, ' ')) || !take_digits(text, 2, hour) ||
        !take(text, ':') || !take_digits(text, 2, minute) || !take(text, ':') || !take_digits(text, 2, second))
        return std::nullopt;
    std::string_view fraction;
    if (take(text, '.')) {
        std::size_t size = std::min(text.find_first_not_of("0123456789"), text.size());
        fraction = text.substr(0, size);
        text.remove_prefix(size);
    }
    chrono::year_month_day date{chrono::year(year), chrono::month(static_cast<unsigned>(month)),
                                chrono::day(static_cast<unsigned>(day))};
    if (text != "Z" || !date.ok() || hour > 23 || minute > 59 || second > 59) return std::nullopt;
    std::int64_t days = chrono::sys_days(date).time_since_epoch().count();
    return combine(((days * 24 + hour) * 60 + minute) * 60 + second, fraction, false, den, places);
}
} // namespace

std::string to_base64(bytes_view raw) {
    std::string text;
    text.reserve((raw.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < raw.size(); i += 3) {
        std::uint32_t three = 0;
        for (std::size_t k = 0; k < 3; ++k)
            three = three << 8 | (i + k < raw.size() ? std::to_integer<std::uint32_t>(raw[i + k]) : 0);
        for (std::size_t k = 0; k < 4; ++k) text += i + k > raw.size() ? '=' : digits64[three >> (18 - 6 * k) & 63];
    }
    return text;
}

std::optional<bytes> from_base64(std::string_view text) {
    static constexpr auto values = [] {
        std::array<std::int8_t, 256> table{};
        table.fill(-1);
        for (std::size_t i = 0; i < 64; ++i)
            table[static_cast<unsigned char>(digits64[i])] = static_cast<std::int8_t>(i);
        return table;
    }();
    if (text.size() % 4 != 0) return std::nullopt;
    std::size_t padding = text.ends_with("==") ? 2 : text.ends_with("=") ? 1 : 0;
    text.remove_suffix(padding);
    bytes raw;
    raw.reserve(text.size() / 4 * 3 + 2);
    std::uint32_t bits = 0;
    int have = 0;
    for (char c : text) {
        int value = values[static_cast<unsigned char>(c)];
        if (value < 0) return std::nullopt;
        bits = (bits << 6 | static_cast<std::uint32_t>(value)) & 0xffffff;
        have += 6;
        if (have >= 8) {
            have -= 8;
            raw.push_back(static_cast<std::byte>(bits >> have & 0xff));
        }
    }
    if ((bits & ((1u << have) - 1)) != 0) return std::nullopt; // one text for one value
    return raw;
}

bool is_utf8(std::string_view text) noexcept {
    while (!text.empty()) {
        std::size_t length = sequence_length(text);
        if (length == 0) return false;
        text.remove_prefix(length);
    }
    return true;
}

void append_json_letter(std::string& out, std::string_view& text) {
    const std::size_t whole = sequence_length(text), length = std::max<std::size_t>(whole, 1);
    const auto first = static_cast<unsigned char>(text[0]);
    if (whole == 0) {
        out += "\xef\xbf\xbd";
    } else if (readable_length(text) > 0) {
        out += text.substr(0, length);
    } else {
        std::uint32_t letter = length == 1 ? first : first & (0x7fu >> length);
        for (std::size_t i = 1; i < length; ++i) letter = letter << 6 | (static_cast<unsigned char>(text[i]) & 0x3fu);
        if (letter < 0x10000) out += fmt::format("\\u{:04x}", letter);
        else out += fmt::format("\\u{:04x}\\u{:04x}", 0xd7c0 + (letter >> 10), 0xdc00 + (letter & 0x3ff));
    }
    text.remove_prefix(length);
}

void append_json_string(std::string& out, std::string_view text) {
    auto plain = [](char c) { return c >= ' ' && c <= '~' && c != '"' && c != '\\'; };
    out += '"';
    while (!text.empty()) {
        auto run = static_cast<std::size_t>(std::ranges::find_if_not(text, plain) - text.begin());
        out += text.substr(0, run);
        text.remove_prefix(run);
        if (text.empty()) break;
        const char c = text[0];
        if (c == '"' || c == '\\' || c == '\n' || c == '\t') {
            out += '\\';
            out += c == '\n' ? 'n' : c == '\t' ? 't' : c;
            text.remove_prefix(1);
        } else {
            append_json_letter(out, text);
        }
    }
    out += '"';
}

void append_json_number(std::string& out, double value) { append_number(out, value); }
void append_json_number(std::string& out, float value) { append_number(out, value); }

void append_json_time(std::string& out, const type_description& type, std::int64_t ticks) {
    auto places = decimal_places(type);
    if (!places) {
        out += fmt::format("\"{} ticks\"", ticks);
        return;
    }
    if (type.kind == type_kind::time_span) {
        // As a reader's double, whose seconds have to be told apart by less than a tick.
        const bool exact = ticks < (std::int64_t{1} << 51) && ticks > -(std::int64_t{1} << 51);
        out += fmt::format(fmt::runtime(exact ? "{}" : "\"{}\""), decimal_seconds(ticks, type.period_den, *places));
        return;
    }
    namespace chrono = std::chrono;
    std::int64_t seconds = floor_div(ticks, type.period_den);
    std::int64_t days = floor_div(seconds, 86400);
    if (days < -719528 || days > 2932896) { // years 0 to 9999
        out += fmt::format("\"{} ticks\"", ticks);
        return;
    }
    out += '"' + ise::iso_8601(chrono::sys_seconds(chrono::seconds(seconds)));
    if (*places > 0) { // the whole seconds alone may lie outside, so the difference is taken without sign
        auto fraction = static_cast<std::uint64_t>(ticks) -
                        static_cast<std::uint64_t>(seconds) * static_cast<std::uint64_t>(type.period_den);
        out.pop_back(); // the Z
        out += fmt::format(".{:0{}}Z", fraction, *places);
    }
    out += '"';
}

std::optional<std::int64_t> ticks_from_text(const type_description& type, std::string_view text) {
    if (text.ends_with(" ticks")) {
        std::int64_t ticks = 0;
        return take_number(text, ticks) && text == " ticks" ? std::optional(ticks) : std::nullopt;
    }
    auto places = decimal_places(type);
    if (!places) return std::nullopt;
    if (type.kind == type_kind::instant)
        if (auto ticks = from_iso(text, type.period_den, *places)) return ticks;
    if (text.ends_with('s')) text.remove_suffix(1);
    bool negative = text.starts_with('-');
    std::int64_t seconds = 0;
    if (!take_number(text, seconds)) return std::nullopt;
    if (!text.empty() && (!take(text, '.') || text.empty())) return std::nullopt;
    return combine(seconds, text, negative, type.period_den, *places);
}

std::optional<std::int64_t> ticks_from_seconds(const type_description& type, double seconds) {
    double ticks =
        std::nearbyint(seconds * static_cast<double>(type.period_den) / static_cast<double>(type.period_num));
    if (!(ticks >= -9.2e18 && ticks <= 9.2e18)) return std::nullopt; // NaN, too
    return static_cast<std::int64_t>(ticks);
}

} // namespace ise::detail
