#include "short_names.hpp"

#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

namespace ise::cli {
namespace {

std::size_t letter_length(const std::string& text, std::size_t at) {
    std::size_t end = at + 1;
    while (end < text.size() && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) ++end;
    return end - at;
}

std::string last_columns(const std::string& text, std::size_t width) {
    auto skip = columns(text) - std::min(columns(text), width);
    std::size_t at = 0;
    for (; skip > 0; --skip) at += letter_length(text, at);
    return text.substr(at);
}

std::string cut_in_the_middle(const std::string& text, std::size_t width) {
    if (columns(text) <= width) return text;
    auto front = (width - 1) / 3;
    auto head = cut(text, front + 1); // with "…"
    return head + last_columns(text, width - columns(head));
}

// The parts of a path become their first letters, from the left, as far as it must be.
std::string with_short_parts(std::string path, std::size_t width) {
    for (std::size_t from = 0; columns(path) > width;) {
        auto to = path.find('/', from);
        if (to == path.npos) break;
        auto first = letter_length(path, from);
        path.erase(from + first, to - from - first);
        from += first + 1;
    }
    return path;
}

} // namespace

std::vector<std::string> short_names(const std::vector<std::string>& names, std::size_t width) {
    width = std::max<std::size_t>(width, 4);
    std::map<std::string, std::string> shortened;
    for (const auto& one : names) shortened.emplace(one, "");
    std::set<std::string> used;
    for (auto& [name, made] : shortened) {
        made = cut_in_the_middle(with_short_parts(name, width), width);
        // A cut in the middle may leave what another is, too.
        for (std::size_t number = 2; !used.insert(made).second; ++number) {
            auto mark = fmt::format("~{}", number);
            made = cut_in_the_middle(with_short_parts(name, width), width - std::min(width - 1, mark.size())) + mark;
        }
    }
    std::vector<std::string> all;
    for (const auto& one : names) all.push_back(shortened.at(one));
    return all;
}

} // namespace ise::cli
