#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

namespace atirma::stress {

/// The text of a report, line by line.
class text {
public:
    template <class... A>
    void line(fmt::format_string<A...> how, A&&... what) {
        all += fmt::format(how, std::forward<A>(what)...);
        all += '\n';
    }
    std::string all;
};

/// Words as they may stand in a cell of a table.
inline std::string in_cell(std::string words) {
    std::ranges::replace(words, '|', '/');
    std::ranges::replace(words, '\n', ' ');
    return words;
}

} // namespace atirma::stress
