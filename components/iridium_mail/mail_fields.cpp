#include <components/iridium_mail/mail_fields.hpp>

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

namespace atirma::iridium_mail {
namespace {

constexpr std::array<std::string_view, 12> months{"jan", "feb", "mar", "apr", "may", "jun",
                                                  "jul", "aug", "sep", "oct", "nov", "dec"};
constexpr std::array<std::string_view, 7> weekdays{"sun", "mon", "tue", "wed", "thu", "fri", "sat"};

bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }

template <std::size_t N>
std::optional<unsigned> place_in(const std::array<std::string_view, N>& names, std::string_view text) noexcept {
    for (unsigned i = 0; i < N; ++i)
        if (same_text(names[i], text)) return i;
    return std::nullopt;
}

std::string titled(std::string_view name) {
    std::string made(name);
    made[0] = static_cast<char>(made[0] - 'a' + 'A');
    return made;
}

} // namespace

std::string_view trimmed(std::string_view text) noexcept {
    constexpr std::string_view blanks = " \t\r\n";
    auto begin = text.find_first_not_of(blanks);
    if (begin == std::string_view::npos) return {};
    return text.substr(begin, text.find_last_not_of(blanks) - begin + 1);
}

std::string lower(std::string_view text) {
    std::string made(text);
    for (char& c : made)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return made;
}

bool same_text(std::string_view a, std::string_view b) noexcept {
    if (a.size() != b.size()) return false;
    for (std::size_t i = 0; i < a.size(); ++i) {
        auto low = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
        if (low(a[i]) != low(b[i])) return false;
    }
    return true;
}

std::vector<mail_field> fields_of(std::string_view text) {
    std::vector<mail_field> found;
    while (!text.empty()) {
        auto line = text.substr(0, text.find('\n'));
        text.remove_prefix(std::min(line.size() + 1, text.size()));
        // The first of the two: a time has colons too, and "Unit Location: Lat = …" both.
        auto split = line.find_first_of(":=");
        if (split == std::string_view::npos) continue;
        auto name = trimmed(line.substr(0, split));
        if (name.empty()) continue;
        found.push_back({lower(name), std::string(trimmed(line.substr(split + 1)))});
    }
    return found;
}

std::optional<std::uint32_t> whole_number(std::string_view text, std::uint32_t most) noexcept {
    std::uint32_t value = 0;
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || problem != std::errc() || end != text.data() + text.size() || value > most) return std::nullopt;
    return value;
}

std::optional<double> decimal(std::string_view text, double most) noexcept {
    double value = 0;
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed);
    if (text.empty() || problem != std::errc() || end != text.data() + text.size()) return std::nullopt;
    if (!std::isfinite(value) || std::abs(value) > most) return std::nullopt;
    return value;
}

std::optional<std::chrono::sys_seconds> session_time(std::string_view text) noexcept {
    std::array<std::string_view, 5> words;
    std::size_t count = 0;
    while (!(text = trimmed(text)).empty()) {
        if (count == words.size()) return std::nullopt;
        words[count] = text.substr(0, text.find_first_of(" \t"));
        text.remove_prefix(words[count++].size());
    }
    if (count != words.size() || !place_in(weekdays, words[0])) return std::nullopt;
    auto month = place_in(months, words[1]);
    auto day = whole_number(words[2], 31);
    auto clock = words[3];
    auto year = whole_number(words[4], 9999);
    if (clock.size() != 8 || clock[2] != ':' || clock[5] != ':') return std::nullopt;
    auto hour = whole_number(clock.substr(0, 2), 23);
    auto minute = whole_number(clock.substr(3, 2), 59);
    auto second = whole_number(clock.substr(6, 2), 60);
    if (!month || !day || !hour || !minute || !second || !year || *year < 1970) return std::nullopt;
    std::chrono::year_month_day date(std::chrono::year(static_cast<int>(*year)), std::chrono::month(*month + 1),
                                     std::chrono::day(*day));
    if (!date.ok()) return std::nullopt;
    return std::chrono::sys_days(date) + std::chrono::hours(*hour) + std::chrono::minutes(*minute) +
           std::chrono::seconds(*second);
}

std::string session_time_text(std::chrono::sys_seconds at) {
    auto day = std::chrono::floor<std::chrono::days>(at);
    std::chrono::year_month_day date(day);
    std::chrono::hh_mm_ss clock(at - day);
    auto weekday = std::chrono::weekday(day).c_encoding();
    return fmt::format("{} {} {:2} {:02}:{:02}:{:02} {:04}", titled(weekdays[weekday]),
                       titled(months[static_cast<unsigned>(date.month()) - 1]), static_cast<unsigned>(date.day()),
                       clock.hours().count(), clock.minutes().count(), clock.seconds().count(),
                       static_cast<int>(date.year()));
}

std::optional<std::string> imei_in(std::string_view text) {
    for (std::size_t i = 0; i < text.size();) {
        auto end = i;
        while (end < text.size() && is_digit(text[end])) ++end;
        if (end - i == 15) return std::string(text.substr(i, 15));
        i = std::max(end, i + 1);
    }
    return std::nullopt;
}

} // namespace atirma::iridium_mail
