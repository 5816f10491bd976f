#include <components/foxglove_gateway/origins.hpp>

#include <algorithm>
#include <array>
#include <string_view>

namespace ise::foxglove {
namespace {

std::string_view host_of_origin(std::string_view origin) {
    auto begin = origin.find("://");
    if (begin == std::string_view::npos) return {};
    origin.remove_prefix(begin + 3);
    auto end = origin.starts_with('[') ? origin.find(']') : origin.find(':');
    if (end == std::string_view::npos) return origin;
    return origin.substr(0, origin[end] == ']' ? end + 1 : end);
}

} // namespace

bool is_allowed_origin(const std::string& origin, const std::vector<std::string>& allowed) {
    static constexpr std::array known = {"https://app.foxglove.dev", "https://studio.foxglove.dev", "file://"};
    if (origin.empty() || std::ranges::find(known, origin) != known.end()) return true;
    if (std::ranges::any_of(allowed, [&](const auto& one) { return one == "*" || one == origin; })) return true;
    if (!origin.starts_with("http://") && !origin.starts_with("https://")) return false;
    auto host = host_of_origin(origin);
    return host == "localhost" || host == "127.0.0.1" || host == "[::1]";
}

} // namespace ise::foxglove
