#include <ise/core/toml_text.hpp>

#include <algorithm>

namespace ise {
namespace {

bool beyond_ascii(char one) noexcept { return (static_cast<unsigned char>(one) & 0x80) != 0; }

std::string_view three(char quote) noexcept { return quote == '"' ? "\"\"\"" : "'''"; }

// From behind the quotes that begin a string to behind those that end it, or to the end of the text.
std::size_t end_of_string(std::string_view text, std::size_t at, char quote, bool lines, std::size_t& stray) noexcept {
    for (; at < text.size(); ++at) {
        if (text[at] == '\\' && quote == '"') {
            auto next = text.find_first_not_of(" \t\r\n", at + 1);
            if (lines && next != at + 1 && next != text.npos) { // the string goes on at the next word
                if (beyond_ascii(text[next])) stray = next;
                at = next - 1;
            } else {
                ++at;
            }
        } else if (text[at] == '\n' && !lines) {
            return at;
        } else if (text[at] == quote && !lines) {
            return at + 1;
        } else if (text[at] == quote && text.substr(at).starts_with(three(quote))) {
            at += 3;
            for (int more = 0; more < 2 && at < text.size() && text[at] == quote; ++more) ++at; // the string's own
            return at;
        }
    }
    return text.size();
}

std::size_t find_stray(std::string_view toml) noexcept {
    std::size_t stray = toml.npos;
    for (std::size_t at = toml.starts_with("\xEF\xBB\xBF") ? 3 : 0; at < toml.size() && stray == toml.npos;) {
        const char one = toml[at];
        if (beyond_ascii(one)) return at;
        if (one == '#') {
            at = std::min(toml.find('\n', at), toml.size());
        } else if (one == '"' || one == '\'') {
            const bool lines = toml.substr(at).starts_with(three(one));
            at = end_of_string(toml, at + (lines ? 3 : 1), one, lines, stray);
        } else {
            ++at;
        }
    }
    return stray;
}

} // namespace

std::optional<text_place> stray_character(std::string_view toml) noexcept {
    const auto at = find_stray(toml);
    if (at == toml.npos) return std::nullopt;
    const auto before = toml.substr(0, at);
    return text_place{static_cast<std::uint32_t>(std::ranges::count(before, '\n') + 1),
                      static_cast<std::uint32_t>(at - (before.rfind('\n') + 1) + 1)};
}

} // namespace ise
