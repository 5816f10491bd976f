#include "pattern.hpp"

namespace ise::cli {
namespace {

bool part_matches(std::string_view pattern, std::string_view part) noexcept {
    // The last star, and how much of the part it takes: it takes more where what is behind it does not fit.
    auto star = pattern.npos;
    std::size_t taken = 0, p = 0, at = 0;
    while (at < part.size()) {
        if (p < pattern.size() && (pattern[p] == '?' || (pattern[p] != '*' && pattern[p] == part[at]))) {
            ++p, ++at;
        } else if (p < pattern.size() && pattern[p] == '*') {
            star = p++;
            taken = at;
        } else if (star != pattern.npos) {
            p = star + 1;
            at = ++taken;
        } else {
            return false;
        }
    }
    return pattern.substr(p).find_first_not_of('*') == pattern.npos;
}

std::string_view take_part(std::string_view& from) noexcept {
    const auto end = from.find('/');
    const auto part = from.substr(0, end);
    from = end == from.npos ? std::string_view() : from.substr(end + 1);
    return part;
}

} // namespace

bool is_pattern(std::string_view name) noexcept { return name.find_first_of("*?") != name.npos; }

// As `part_matches`, with parts in place of letters: linear in what a `**` takes, whatever the pattern.
bool matches(std::string_view pattern, std::string_view path) noexcept {
    auto left = pattern, rest = path;
    std::string_view behind_stars, retry;
    bool stars = false;
    bool done = rest.empty();
    while (!done) {
        auto next = left;
        auto part = take_part(next);
        auto more = rest;
        auto name = take_part(more);
        if (part == "**") {
            stars = true;
            behind_stars = next;
            retry = rest;
            left = next;
            if (left.empty()) return true;
            continue;
        }
        if (!left.empty() && part_matches(part, name)) {
            left = next;
            rest = more;
        } else if (stars && !retry.empty()) {
            take_part(retry);
            rest = retry;
            left = behind_stars;
        } else {
            return false;
        }
        done = rest.empty();
        if (done && !left.empty() && left != "**" && stars && !retry.empty()) {
            take_part(retry);
            rest = retry;
            left = behind_stars;
            done = rest.empty();
        }
    }
    return left.empty() || left == "**";
}

std::string prefix_of(std::string_view pattern) {
    std::string prefix;
    while (!pattern.empty()) {
        auto part = take_part(pattern);
        if (is_pattern(part)) break;
        if (!prefix.empty()) prefix += '/';
        prefix += part;
    }
    return prefix;
}

} // namespace ise::cli
