#include <ise/component/nearest.hpp>

#include <algorithm>
#include <numeric>
#include <utility>

namespace ise {
namespace {

std::size_t name_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = std::exchange(row[0], i);
        for (std::size_t j = 1; j <= b.size(); ++j) {
            std::size_t changed = diagonal + (a[i - 1] != b[j - 1] ? 1 : 0);
            diagonal = row[j];
            row[j] = std::min({row[j] + 1, row[j - 1] + 1, changed});
        }
    }
    return row.back();
}

} // namespace

std::vector<std::string> nearest(std::string_view wanted, const std::vector<std::string>& known) {
    constexpr std::size_t longest = 256, most = 3;
    auto asked = wanted.substr(0, longest);
    std::vector<std::pair<std::size_t, std::string>> found;
    for (const auto& name : known) {
        auto distance = name_distance(asked, std::string_view(name).substr(0, longest));
        // A part of the path, "boat" for "atirma/boat", is as good as a slip of the pen.
        if (!wanted.empty() && name.find(wanted) != std::string::npos) distance = std::min<std::size_t>(distance, 1);
        if (distance <= std::max<std::size_t>(2, asked.size() / 3)) found.emplace_back(distance, name);
    }
    std::ranges::sort(found);
    std::vector<std::string> names;
    for (auto& [distance, name] : found)
        if (names.size() < most) names.push_back(std::move(name));
    return names;
}

} // namespace ise
