#include <ise/access/pattern.hpp>

#include <fmt/format.h>

namespace ise::access {
namespace {

// Linear but for the wildcards: after a mismatch it goes on behind the last `*`, or, where that cannot reach, behind
// the last `**`.
bool matches_one(std::string_view pattern, std::string_view text) noexcept {
    constexpr auto none = std::string_view::npos;
    std::size_t p = 0, t = 0;
    std::size_t star = none, star_at = 0, wide = none, wide_at = 0;
    for (;;) {
        if (p < pattern.size() && pattern[p] == '*') {
            if (pattern.substr(p).starts_with("**")) {
                while (p < pattern.size() && pattern[p] == '*') ++p;
                wide = p, wide_at = t;
                star = none;
            } else {
                star = ++p, star_at = t;
            }
            continue;
        }
        if (t == text.size() && p == pattern.size()) return true;
        if (t < text.size() && p < pattern.size() && pattern[p] == text[t]) {
            ++p, ++t;
            continue;
        }
        if (star != none && star_at < text.size() && text[star_at] != '/') {
            p = star, t = ++star_at;
        } else if (wide != none && wide_at < text.size()) {
            p = wide, t = ++wide_at;
            star = none;
        } else {
            return false;
        }
    }
}

// Unfolds the first braces of `text`, and those in what that gives.
result<void> unfold(const std::string& text, std::vector<std::string>& into) {
    auto open = text.find('{');
    auto wrong = [&](std::string_view why) {
        return failure(errc::invalid_argument, fmt::format("'{}' is no pattern: {}", text, why));
    };
    if (open == text.npos) {
        if (text.find('}') != text.npos) return wrong("a '}' without its '{'");
        if (into.size() >= pattern::max_alternatives)
            return wrong(fmt::format("its braces unfold to more than {}", pattern::max_alternatives));
        into.push_back(text);
        return {};
    }
    auto close = text.find_first_of("{}", open + 1);
    if (close == text.npos) return wrong("a '{' without its '}'");
    if (text[close] == '{') return wrong("braces within braces");
    auto inside = text.substr(open + 1, close - open - 1);
    if (text.substr(0, open).find('}') != text.npos) return wrong("a '}' without its '{'");
    for (std::size_t from = 0;;) {
        auto comma = inside.find(',', from);
        auto one = inside.substr(from, comma == inside.npos ? comma : comma - from);
        auto made = unfold(text.substr(0, open) + one + text.substr(close + 1), into);
        if (!made) return made;
        if (comma == inside.npos) return {};
        from = comma + 1;
    }
}

} // namespace

result<pattern> pattern::parse(std::string_view text) {
    if (text.empty()) return failure(errc::invalid_argument, "a pattern is empty");
    if (text.size() > max_bytes)
        return failure(errc::invalid_argument,
                       fmt::format("a pattern of {} bytes, {} are allowed", text.size(), max_bytes));
    pattern made;
    made.text_ = text;
    auto unfolded = unfold(made.text_, made.alternatives_);
    if (!unfolded) return unfolded.error();
    for (const auto& one : made.alternatives_) {
        auto& ends = made.fixed_.emplace_back();
        ends.first = one.find('*');
        ends.whole = ends.first == one.npos;
        if (!ends.whole) ends.last = one.size() - one.rfind('*') - 1;
    }
    made.plain_ = text.find_first_of("*{") == text.npos;
    return made;
}

bool pattern::matches(std::string_view text) const noexcept {
    for (std::size_t at = 0; at < alternatives_.size(); ++at) {
        std::string_view one = alternatives_[at];
        const auto& ends = fixed_[at];
        if (ends.whole) {
            if (one == text) return true;
            continue;
        }
        // Most do not match, and mostly this shows it.
        if (!text.starts_with(one.substr(0, ends.first)) || !text.ends_with(one.substr(one.size() - ends.last)))
            continue;
        if (matches_one(one, text)) return true;
    }
    return false;
}

} // namespace ise::access
