#include <ise/core/toml_text.hpp>

#include <algorithm>
#include <string>

namespace ise {
namespace {

bool beyond_ascii(char one) noexcept { return (static_cast<unsigned char>(one) & 0x80) != 0; }

std::string_view three(char quote) noexcept { return quote == '"' ? "\"\"\"" : "'''"; }

// From behind the quotes that begin a string to behind those that end it, or to the end of the text.
std::size_t end_of_string(std::string_view text, std::size_t at, char quote, bool lines, std::size_t& stray) noexcept {
    for (; at < text.size(); ++at) {
        if (text[at] == '\\' && quote == '"') {
            // In a string of several lines: whether it is an escape, or the string goes on at the next word.
            auto next = text.find_first_not_of(" \t\r\n\v\f", at + 1);
            if (lines && next != text.npos && beyond_ascii(text[next])) stray = next;
            at = lines && next != text.npos && next != at + 1 ? next - 1 : at + 1;
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

// Whether a quote begins a string there. Within a value that is no string, toml++ looks ahead to the end of the word,
// and a quote in it is a character like any other.
class position {
public:
    bool string_begins() const noexcept { return keys() || !within_word_; }
    void pass_string() noexcept { within_word_ = true; }

    void pass(char one) {
        const bool begins = !keys() && !within_word_;
        within_word_ = std::string_view(" \t\r\n,]}").find(one) == std::string_view::npos;
        if (one == '\n' && open_.empty()) after_equals_ = false;
        else if (one == '=' && keys()) begin_word(true);
        else if (one == ',' && !open_.empty()) after_equals_ = open_.back() == '[';
        else if (begins && (one == '[' || one == '{')) open(one);
        else if ((one == ']' || one == '}') && !open_.empty()) close();
    }

private:
    bool keys() const noexcept { return !after_equals_; }

    void begin_word(bool value) noexcept {
        after_equals_ = value;
        within_word_ = false;
    }

    void open(char bracket) {
        open_ += bracket;
        begin_word(bracket == '[');
    }

    void close() noexcept {
        open_.pop_back();
        after_equals_ = true; // what the brackets belong to is a value
    }

    std::string open_; ///< brackets of arrays and inline tables
    bool after_equals_ = false, within_word_ = false;
};

std::size_t find_stray(std::string_view toml) {
    std::size_t stray = toml.npos;
    position here;
    for (std::size_t at = toml.starts_with("\xEF\xBB\xBF") ? 3 : 0; at < toml.size() && stray == toml.npos;) {
        const char one = toml[at];
        if (beyond_ascii(one)) return at;
        if (one == '#') {
            at = std::min(toml.find('\n', at), toml.size());
        } else if ((one == '"' || one == '\'') && here.string_begins()) {
            const bool lines = toml.substr(at).starts_with(three(one));
            at = end_of_string(toml, at + (lines ? 3 : 1), one, lines, stray);
            here.pass_string();
        } else {
            here.pass(one);
            ++at;
        }
    }
    return stray;
}

} // namespace

std::optional<text_place> stray_character(std::string_view toml) {
    const auto at = find_stray(toml);
    if (at == toml.npos) return std::nullopt;
    const auto before = toml.substr(0, at);
    return text_place{static_cast<std::uint32_t>(std::ranges::count(before, '\n') + 1),
                      static_cast<std::uint32_t>(at - (before.rfind('\n') + 1) + 1)};
}

} // namespace ise
