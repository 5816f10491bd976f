#include <ise/packet/enums.hpp>

namespace ise::detail {

std::vector<enumerator> named_values(std::string_view words, const candidate_values& values) {
    std::vector<enumerator> found;
    // "… values = {a, b}; …" (g++) or "… values = <a, b>]" (clang): the list begins behind the last "values = ".
    constexpr std::string_view before = "values = ";
    std::size_t at = words.rfind(before);
    if (at == std::string_view::npos) return found;
    at += before.size() + 1;
    std::size_t begin = at;
    int depth = 0;
    for (std::size_t i = 0; at < words.size() && i < values.size(); ++at) {
        char c = words[at];
        if (c == '\'') { // a number of an enum over char: '\'' and ',' are among them
            std::size_t end = words.find('\'', at + (at + 1 < words.size() && words[at + 1] == '\\' ? 3 : 2));
            if (end == std::string_view::npos) break;
            at = end;
            continue;
        }
        bool closes = c == ')' || c == '>' || c == '}';
        if (c == '(' || c == '<' || c == '{') ++depth;
        if (depth == 0 && (c == ',' || closes)) {
            std::string_view name = last_identifier(words.substr(begin, at - begin));
            if (!name.empty()) found.push_back({std::string(name), values[i]});
            ++i;
            begin = at + 1;
            if (closes) break;
        } else if (closes) {
            --depth;
        }
    }
    return found;
}

} // namespace ise::detail
