#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace ise::cli {

/// Rows under headings, for people. The last column takes what is left of the width and is cut there; no line is wider.
class table {
public:
    explicit table(std::vector<std::string> headings) { rows_.push_back(std::move(headings)); }

    /// As many cells as headings, which are made printable here.
    void add(std::vector<std::string> cells);
    /// Lines of `width` columns; 0: nothing is cut. Where less than `for_last` (default: all that it takes) is left for
    /// the last column, others are left out: those of `less_important`, by heading, the first one first. Where that is
    /// not enough, the last column and then the widest of the others are cut.
    std::string text(std::size_t width = 0, const std::string& indent = {},
                     const std::vector<std::string_view>& less_important = {},
                     std::optional<std::size_t> for_last = std::nullopt) const;

private:
    std::vector<std::vector<std::string>> rows_;
};

} // namespace ise::cli
