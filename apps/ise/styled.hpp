#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace ise {
class environment;
}

namespace ise::cli {

/// Standard output is a terminal, and NO_COLOR is not set (https://no-color.org).
bool has_colours(const environment& env);

/// What a text means; the terminal chooses how that looks.
enum class style : std::uint8_t { plain, dim, good, warning, bad, heading, accent };

struct styled_text {
    std::string text; ///< printable, without line ends
    style how = style::plain;
};

/// A line of a page.
struct styled_line {
    std::vector<styled_text> parts;
    bool selected = false;

    void add(std::string text, style how = style::plain) { parts.push_back({std::move(text), how}); }
    /// Without styles.
    std::string text() const;
};
using styled_page = std::vector<styled_line>;

/// The line cut to `width` columns.
styled_line fitted(styled_line line, std::size_t width);

/// The lines for standard output, cut to `width` columns (0: not at all), with the terminal's colours or plain.
std::string printed(const styled_page& page, std::size_t width, bool colours);

/// A key, as the terminal names it.
struct key_press {
    enum class kind : std::uint8_t {
        text, ///< `typed`
        up,
        down,
        left,
        right,
        page_up,
        page_down,
        home,
        end,
        enter,
        escape,
        backspace,
        tab,
        back_tab,
        resized, ///< the terminal, not a key
    };
    kind what = kind::text;
    std::string typed; ///< one character, UTF-8
};

} // namespace ise::cli
