#include <components/mail/imap_text.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

char upper(char c) noexcept { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; }

bool same(std::string_view a, std::string_view b) noexcept {
    if (a.size() != b.size()) return false;
    for (std::size_t i = 0; i < a.size(); ++i)
        if (upper(a[i]) != upper(b[i])) return false;
    return true;
}

/// Cuts the first word off.
std::string_view word(std::string_view& rest) noexcept {
    while (rest.starts_with(' ')) rest.remove_prefix(1);
    auto first = rest.substr(0, rest.find(' '));
    rest.remove_prefix(first.size());
    return first;
}

} // namespace

std::optional<std::uint32_t> imap_number(std::string_view digits) noexcept {
    if (digits.empty() || digits.size() > 10) return std::nullopt;
    std::uint64_t value = 0;
    for (char c : digits) {
        if (c < '0' || c > '9') return std::nullopt;
        value = value * 10 + static_cast<unsigned>(c - '0');
    }
    if (value > 0xffffffffu) return std::nullopt;
    return static_cast<std::uint32_t>(value);
}

ise::result<std::string> imap_quoted(std::string_view text) {
    std::string made = "\"";
    for (char c : text) {
        if (c < ' ' || c > '~')
            return ise::failure(
                ise::errc::invalid_argument,
                fmt::format("\"{}\" cannot be the name of a folder: only printable ASCII can", imap_shown(text)));
        if (c == '"' || c == '\\') made += '\\';
        made += c;
    }
    return made + "\"";
}

bool imap_begins(std::string_view text, std::string_view wanted) noexcept { return same(word(text), wanted); }

std::optional<std::vector<std::uint32_t>> imap_found(std::string_view text) {
    if (!same(word(text), "SEARCH")) return std::nullopt;
    std::vector<std::uint32_t> found;
    for (auto next = word(text); !next.empty(); next = word(text)) {
        auto number = imap_number(next);
        if (!number || *number == 0) return std::nullopt;
        found.push_back(*number);
    }
    return found;
}

std::optional<std::uint32_t> imap_exists(std::string_view text) noexcept {
    auto number = imap_number(word(text));
    if (!same(word(text), "EXISTS")) return std::nullopt;
    return number;
}

std::optional<std::string_view> imap_code(std::string_view text, std::string_view name) noexcept {
    word(text); // OK, NO, BAD
    while (text.starts_with(' ')) text.remove_prefix(1);
    auto end = text.find(']');
    if (!text.starts_with('[') || end == std::string_view::npos) return std::nullopt;
    auto inside = text.substr(1, end - 1);
    if (!same(word(inside), name)) return std::nullopt;
    while (inside.starts_with(' ')) inside.remove_prefix(1);
    return inside;
}

bool imap_has_capability(std::string_view text, std::string_view name) noexcept {
    if (!same(word(text), "CAPABILITY")) return false;
    for (auto next = word(text); !next.empty(); next = word(text))
        if (same(next, name)) return true;
    return false;
}

std::optional<std::uint32_t> imap_fetched_uid(std::string_view text) noexcept {
    if (!imap_number(word(text)) || !same(word(text), "FETCH")) return std::nullopt;
    for (auto next = word(text); !next.empty(); next = word(text)) {
        if (next.starts_with('(')) next.remove_prefix(1);
        if (!same(next, "UID")) continue;
        auto number = word(text);
        if (number.ends_with(')')) number.remove_suffix(1);
        return imap_number(number);
    }
    return std::nullopt;
}

std::string imap_shown(std::string_view line) {
    constexpr std::size_t most = 200;
    std::string made(line.substr(0, most));
    for (char& c : made)
        if (c < ' ' || c > '~') c = ' ';
    if (line.size() > most) made += "...";
    return made;
}

} // namespace atirma
