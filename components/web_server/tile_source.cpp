#include <components/web_server/tile_source.hpp>

#include <ise/core/error.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace atirma {

std::string origin_of(std::string_view url) {
    auto host = url.find("://");
    if (host == std::string_view::npos) return {};
    return std::string(url.substr(0, std::min(url.find('/', host + 3), url.size())));
}

void check(const tile_source& tiles) {
    if (tiles.url.empty()) return;
    auto origin = origin_of(tiles.url);
    bool web = origin.starts_with("https://") || origin.starts_with("http://");
    auto host = web ? origin.substr(origin.find("://") + 3) : std::string();
    // The origin becomes part of a header: nothing there may end a directive.
    bool plain = !host.empty() && std::all_of(host.begin(), host.end(), [](unsigned char c) {
        return std::isalnum(c) || c == '.' || c == '-' || c == ':' || c == '[' || c == ']';
    });
    bool places = true;
    for (auto part : {"{z}", "{x}", "{y}"}) places = places && tiles.url.find(part) != std::string::npos;
    if (!plain || !places)
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("web server: \"{}\" is no address of map tiles; use such as "
                                     "https://tiles.example.org/{{z}}/{{x}}/{{y}}.png (--tiles)",
                                     tiles.url));
}

} // namespace atirma
