#pragma once
#include <span>
#include <string_view>

namespace atirma {

/// A file of the page, as it lies in the binary. Everything lives as long as the program.
struct asset {
    std::string_view path;         ///< "/app.js"
    std::string_view content_type; ///< "text/javascript; charset=utf-8"
    std::string_view bytes;
    std::string_view gzip; ///< the same, compressed; empty where that is no smaller
    std::string_view etag; ///< quoted, strong for `bytes`
};

/// The tracking page: our files and Leaflet. "/" is index.html.
std::span<const asset> page_assets() noexcept;

} // namespace atirma
