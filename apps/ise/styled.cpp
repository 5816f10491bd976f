#include "styled.hpp"

#include "text.hpp"

#include <ise/core/environment.hpp>

#include <fmt/color.h>
#include <fmt/format.h>

#include <unistd.h>

namespace ise::cli {
namespace {

fmt::text_style look_of(style how) {
    using enum fmt::terminal_color;
    switch (how) {
        case style::dim: return fmt::text_style(fmt::emphasis::faint);
        case style::good: return fmt::fg(green);
        case style::warning: return fmt::fg(yellow);
        case style::bad: return fmt::fg(red) | fmt::emphasis::bold;
        case style::heading: return fmt::text_style(fmt::emphasis::bold);
        case style::accent: return fmt::fg(cyan);
        default: return {};
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
                       ? fmt::format(look_of(part.how), "{}", part.text)
                       : part.text;
        all += '\n';
    }
    return all;
}

} // namespace ise::cli
