#pragma once
#include <ise/http/http_server.hpp>

#include <span>

namespace atirma {

/// The tracking page: our files and Leaflet. "/" is index.html.
std::span<const ise::static_file> page_assets() noexcept;

} // namespace atirma
