#pragma once
#include <string>
#include <vector>

namespace ise::cli {

/// Rows under headings, for people. The last column takes what is left of the width and is cut there.
class table {
public:
    explicit table(std::vector<std::string> headings) { rows_.push_back(std::move(headings)); }

    /// As many cells as headings, which are made printable here.
    void add(std::vector<std::string> cells);
    /// `width` 0: nothing is cut.
    std::string text(std::size_t width = 0, const std::string& indent = {}) const;

private:
    std::vector<std::vector<std::string>> rows_;
};

} // namespace ise::cli
