#include "styled.hpp"

#include "text.hpp"

#include <ise/core/environment.hpp>

#include <fmt/format.h>

#include <unistd.h>

namespace ise::cli {
namespace {

// The parameters of the terminal's "select graphic rendition".
const char* look_of(style how) {
    switch (how) {
        case style::dim: return "2";
        case style::good: return "32";
        case style::warning: return "33";
        case style::bad: return "1;31";
        case style::heading: return "1";
        case style::accent: return "36";
        default: return "0";
    }
}

} // namespace

bool has_colours(const environment& env) {
    if (::isatty(STDOUT_FILENO) != 1) return false;
    auto none = env.variable("NO_COLOR");
    return !none || none->empty();
}

std::string styled_line::text() const {
    std::string all;
    for (const auto& one : parts) all += one.text;
    return all;
}

styled_line fitted(styled_line line, std::size_t width) {
    std::size_t used = 0;
    for (auto& part : line.parts) {
        part.text = cut(part.text, width - used);
        used += columns(part.text);
    }
    return line;
}

std::string printed(const styled_page& page, std::size_t width, bool colours) {
    std::string all;
    for (const auto& one : page) {
        auto line = width == 0 ? one : fitted(one, width);
        for (const auto& part : line.parts)
            all += colours && part.how != style::plain && !part.text.empty()
                       ? fmt::format("\x1b[{}m{}\x1b[0m", look_of(part.how), part.text)
                       : part.text;
        all += '\n';
    }
    return all;
}

} // namespace ise::cli
