#include "text.hpp"

#include <ise/access/guard.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/readable.hpp>
#include <ise/packet/detail/text_forms.hpp>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>

namespace ise::cli {
namespace {

bool continues(char byte) { return (static_cast<unsigned char>(byte) & 0xC0) == 0x80; }

// 0: from other hosts, …
int nearness(const std::string& text) {
    auto at = endpoint::parse(text);
    if (!at || !within_host(*at)) return 0;
    return at->has_port() ? 1 : 256 - at->kind->rank;
}

} // namespace

std::string show_duration(duration length) {
    double seconds = std::chrono::duration<double>(length).count();
    double size = std::abs(seconds);
    // The next unit from where three digits would not do: 999.6 ms is 1 s, not 1e+03 ms.
    if (size < 0.9995e-3) return fmt::format("{:.3g} us", seconds * 1e6);
    if (size < 0.9995) return fmt::format("{:.3g} ms", seconds * 1e3);
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
        auto length = keep_lines && text.front() == '\n' ? 1 : readable_length(text);
        if (length > 0) shown += text.substr(0, length);
        else shown += "\uFFFD";
        text.remove_prefix(std::max<std::size_t>(length, 1));
    }
    return shown;
}

std::string readable_json(std::string_view text) {
    if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3); // a byte order mark
    if (!nlohmann::json::accept(text)) return "null";
    std::string line;
    while (!text.empty()) {
        if (text.front() == '\n' || text.front() == '\r' || text.front() == '\t') { // between values
            line += ' ';
            text.remove_prefix(1);
        } else {
            ise::detail::append_json_letter(line, text);
        }
    }
    return line;
}

std::string cut(std::string_view text, std::size_t width) {
    if (columns(text) <= width) return std::string(text);
    if (width == 0) return {};
    std::size_t end = 0;
    for (std::size_t shown = 0; shown + 1 < width; ++shown) do
            ++end;
        while (end < text.size() && continues(text[end]));
    return std::string(text.substr(0, end)) + "…";
}

std::string indented(std::string_view text, std::string_view by) {
    std::string out(by);
    for (char letter : text) {
        out += letter;
        if (letter == '\n') out += by;
    }
    return out + '\n';
}

std::vector<std::string> reachable_first(std::vector<std::string> endpoints) {
    std::ranges::stable_sort(endpoints, {}, nearness);
    return endpoints;
}

std::string enumerate(const std::vector<std::string>& names) {
    std::string text;
    for (std::size_t at = 0; at < names.size(); ++at)
        text += (at == 0 ? "" : at + 1 == names.size() ? " and " : ", ") + names[at];
    return text;
}

bool has_unusable_policy(const std::string& why) { return why.find(access::unusable_policy) != why.npos; }

} // namespace ise::cli
