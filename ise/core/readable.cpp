#include <ise/core/readable.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <utility>

namespace ise {
namespace {

// The character at the start of a text and its length; nothing where there is no UTF-8.
std::optional<std::pair<char32_t, std::size_t>> character_at(std::string_view text) {
    auto first = static_cast<unsigned char>(text.front());
    if (first < 0x80) return std::pair(char32_t{first}, std::size_t{1});
    std::size_t length = first >= 0xc2 && first <= 0xdf   ? 2
                         : (first & 0xf0) == 0xe0         ? 3
                         : first >= 0xf0 && first <= 0xf4 ? 4
                                                          : 0;
    if (length == 0 || text.size() < length) return std::nullopt;
    char32_t letter = first & (0x7fu >> length);
    for (std::size_t i = 1; i < length; ++i) {
        auto next = static_cast<unsigned char>(text[i]);
        if ((next & 0xc0) != 0x80) return std::nullopt;
        letter = letter << 6 | (next & 0x3fu);
    }
    constexpr std::array<char32_t, 5> least{0, 0, 0x80, 0x800, 0x10000};
    if (letter < least[length] || letter > 0x10ffff || (letter >= 0xd800 && letter <= 0xdfff)) return std::nullopt;
    return std::pair(letter, length);
}

// What a terminal obeys, or does not show: controls, directions, joiners, line ends, tags.
bool is_unseen(char32_t letter) {
    auto within = [letter](char32_t first, char32_t last) { return letter >= first && letter <= last; };
    return within(0x80, 0x9f) || letter == 0xad || within(0x200b, 0x200f) || within(0x2028, 0x202e) ||
           within(0x2060, 0x206f) || letter == 0xfeff || within(0xfff9, 0xfffb) || within(0xe0000, 0xe0fff);
}

// Bytes of the first `count` characters.
std::size_t bytes_of(std::string_view text, std::size_t count) {
    std::size_t at = 0;
    while (at < text.size() && (count > 0 || (static_cast<unsigned char>(text[at]) & 0xc0) == 0x80)) {
        if ((static_cast<unsigned char>(text[at]) & 0xc0) != 0x80) --count;
        ++at;
    }
    return at;
}

void wrap_line(std::string& out, std::string_view line, std::size_t width) {
    auto begin = std::min(line.find_first_not_of(' '), line.size());
    auto gap = line.find("  ", begin);
    auto indent = gap == line.npos ? begin : std::min(line.find_first_not_of(' ', gap), line.size());
    if (indent > width / 2) indent = begin;
    for (std::size_t room = width; columns(line) > room; room = width - indent) {
        auto most = bytes_of(line, room);
        auto least = room == width ? indent : 0;
        auto to = line.rfind(' ', most);
        auto next = to + 1;
        if (to == line.npos || to <= least) { // a word that is longer
            to = line.substr(0, most).rfind(',') + 1;
            if (to <= least) to = most;
            next = to;
        }
        out.append(line.substr(0, to)) += '\n';
        out.append(indent, ' ');
        line.remove_prefix(next);
    }
    out.append(line) += '\n';
}

} // namespace

std::size_t columns(std::string_view text) noexcept {
    return static_cast<std::size_t>(
        std::ranges::count_if(text, [](unsigned char byte) { return (byte & 0xc0) != 0x80; }));
}

std::string wrapped(std::string_view text, std::size_t width) {
    std::string out;
    for (std::size_t from = 0; from < text.size();) {
        auto to = std::min(text.find('\n', from), text.size());
        wrap_line(out, text.substr(from, to - from), width);
        from = to + 1;
    }
    return out;
}

std::size_t readable_length(std::string_view text) noexcept {
    if (text.empty()) return 0;
    auto letter = character_at(text);
    return letter && letter->first >= 0x20 && letter->first != 0x7f && !is_unseen(letter->first) ? letter->second : 0;
}

std::string readable(std::string_view line, std::size_t max_bytes) {
    std::string shown;
    while (!line.empty()) {
        if (shown.size() >= max_bytes) return shown + "...";
        if (auto length = readable_length(line); length > 0) {
            shown += line.substr(0, length);
            line.remove_prefix(length);
            continue;
        }
        auto letter = character_at(line);
        if (!letter) shown += fmt::format("\\x{:02x}", static_cast<unsigned char>(line.front()));
        else if (letter->first < 0x20 || letter->first == 0x7f) shown += ' ';
        else shown += fmt::format("\\u{{{:x}}}", static_cast<std::uint32_t>(letter->first));
        line.remove_prefix(letter ? letter->second : 1);
    }
    return shown;
}

} // namespace ise
