#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <utility>

namespace ise::cli {
namespace {

bool continues(char byte) { return (static_cast<unsigned char>(byte) & 0xC0) == 0x80; }

// Bytes of the UTF-8 character at the start of `text`; 0 if there is none.
std::size_t character_length(std::string_view text) {
    auto first = static_cast<unsigned char>(text.front());
    std::size_t length = first < 0x80 ? 1 : first >= 0xC2 && first < 0xE0 ? 2 : first >= 0xE0 && first < 0xF0 ? 3 : first >= 0xF0 && first < 0xF5 ? 4 : 0;
    if (length > text.size()) return 0;
    for (std::size_t at = 1; at < length; ++at)
        if (!continues(text[at])) return 0;
    // C1 control characters do what escape sequences do.
    if (length == 2 && first == 0xC2 && static_cast<unsigned char>(text[1]) < 0xA0) return 0;
    return length;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = std::exchange(row[0], i);
        for (std::size_t j = 1; j <= b.size(); ++j) {
            std::size_t changed = diagonal + (a[i - 1] != b[j - 1] ? 1 : 0);
            diagonal = row[j];
            row[j] = std::min({row[j] + 1, row[j - 1] + 1, changed});
        }
    }
    return row.back();
}

} // namespace

result<duration> parse_duration(std::string_view text) {
    double number = 0;
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
    auto unit = text.substr(static_cast<std::size_t>(end - text.data()));
    double seconds = unit.empty() || unit == "s" ? 1 : unit == "ms" ? 1e-3 : unit == "us" ? 1e-6 : unit == "m" || unit == "min" ? 60 : unit == "h" ? 3600 : 0;
    constexpr double most_seconds = 1e9; // 30 years
    if (problem != std::errc() || seconds == 0 || !(number >= 0) || number * seconds > most_seconds)
        return failure(errc::invalid_argument, fmt::format("'{}' is no duration: write 5s, 250ms, 1.5m or 2h", printable(text)));
    return std::chrono::duration_cast<duration>(std::chrono::duration<double>(number * seconds));
}

std::string show_duration(duration length) {
    double seconds = std::chrono::duration<double>(length).count();
    double size = std::abs(seconds);
    if (size < 1e-3) return fmt::format("{:.3g} us", seconds * 1e6);
    if (size < 1) return fmt::format("{:.3g} ms", seconds * 1e3);
    if (size < 99.5) return fmt::format("{:.3g} s", seconds);
    auto minutes = std::llround(seconds / 60);
    if (minutes < 100) return fmt::format("{} min", minutes);
    return fmt::format("{} h {:02} min", minutes / 60, minutes % 60);
}

std::string show_bytes(std::uint64_t count) {
    auto size = static_cast<double>(count);
    if (count < 1000) return fmt::format("{} B", count);
    if (size < 1e6) return fmt::format("{:.1f} kB", size / 1e3);
    if (size < 1e9) return fmt::format("{:.1f} MB", size / 1e6);
    return fmt::format("{:.1f} GB", size / 1e9);
}

std::string printable(std::string_view text, bool keep_lines) {
    std::string shown;
    while (!text.empty()) {
        auto length = character_length(text);
        bool line_end = keep_lines && text.front() == '\n';
        if (length == 0 || (length == 1 && !line_end && (static_cast<unsigned char>(text.front()) < 0x20 || text.front() == 0x7F))) {
            shown += "\uFFFD";
            length = 1;
        } else {
            shown += text.substr(0, length);
        }
        text.remove_prefix(length);
    }
    return shown;
}

std::size_t columns(std::string_view text) {
    return static_cast<std::size_t>(std::ranges::count_if(text, [](char byte) { return !continues(byte); }));
}

std::string cut(std::string_view text, std::size_t width) {
    if (columns(text) <= width) return std::string(text);
    if (width == 0) return {};
    std::size_t end = 0;
    for (std::size_t shown = 0; shown + 1 < width; ++shown)
        do ++end;
        while (end < text.size() && continues(text[end]));
    return std::string(text.substr(0, end)) + "…";
}

std::vector<std::string> nearest(std::string_view wanted, const std::vector<std::string>& known) {
    constexpr std::size_t longest = 256, most = 3;
    auto asked = wanted.substr(0, longest);
    std::vector<std::pair<std::size_t, std::string>> found;
    for (const auto& name : known) {
        auto distance = edit_distance(asked, std::string_view(name).substr(0, longest));
        // A part of the path, "boat" for "atirma/boat", is as good as a slip of the pen.
        if (name.find(wanted) != std::string::npos) distance = std::min<std::size_t>(distance, 1);
        if (distance <= std::max<std::size_t>(2, asked.size() / 3)) found.emplace_back(distance, name);
    }
    std::ranges::sort(found);
    std::vector<std::string> names;
    for (auto& [distance, name] : found)
        if (names.size() < most) names.push_back(std::move(name));
    return names;
}

std::string enumerate(const std::vector<std::string>& names) {
    std::string text;
    for (std::size_t at = 0; at < names.size(); ++at) text += (at == 0 ? "" : at + 1 == names.size() ? " and " : ", ") + names[at];
    return text;
}

} // namespace ise::cli
