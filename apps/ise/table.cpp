#include "table.hpp"

#include "text.hpp"

#include <algorithm>

namespace ise::cli {

void table::add(std::vector<std::string> cells) {
    for (auto& cell : cells) cell = printable(cell);
    cells.resize(rows_.front().size());
    rows_.push_back(std::move(cells));
}

std::string table::text(std::size_t width, const std::string& indent,
                        const std::vector<std::string_view>& less_important,
                        std::optional<std::size_t> for_last) const {
    constexpr std::size_t gap = 2, min_last = 12, least = 4;
    auto count = rows_.front().size();
    std::vector<std::size_t> widths(count, 0);
    for (const auto& row : rows_)
        for (std::size_t at = 0; at < count; ++at) widths[at] = std::max(widths[at], columns(row[at]));
    std::vector<bool> shown(count, true);
    auto wanted = std::min(widths.back(), for_last.value_or(widths.back()));
    std::size_t before = indent.size();
    for (std::size_t at = 0; at + 1 < count; ++at) before += widths[at] + gap;
    for (auto heading : less_important) {
        if (width == 0 || before + wanted <= width) break;
        auto at = static_cast<std::size_t>(std::ranges::find(rows_.front(), heading) - rows_.front().begin());
        shown[at] = false;
        before -= widths[at] + gap;
    }
    auto room_for_last = std::min(widths.back(), for_last.value_or(min_last));
    while (width != 0 && before + room_for_last > width) {
        std::size_t widest = count;
        for (std::size_t at = 0; at + 1 < count; ++at)
            if (shown[at] && widths[at] > least && (widest == count || widths[at] > widths[widest])) widest = at;
        if (widest == count) break;
        --widths[widest];
        --before;
    }
    std::string text;
    for (const auto& row : rows_) {
        auto line = indent;
        for (std::size_t at = 0; at + 1 < count; ++at)
            if (shown[at])
                line += cut(row[at], widths[at]) +
                        std::string(widths[at] + gap - std::min(widths[at], columns(row[at])), ' ');
        line += width == 0 ? row.back() : cut(row.back(), std::max(min_last, width > before ? width - before : 0));
        line.erase(line.find_last_not_of(' ') + 1);
        text += line + '\n';
    }
    return text;
}

} // namespace ise::cli
