#pragma once
#include <string>
#include <string_view>

namespace atirma {

/// Pictures of a chart below the page's own coastline, from a server that the operator of the page chooses. Off by
/// default: without it, no viewer's browser asks any other host.
struct tile_source {
    std::string url;         ///< "https://tiles.example.org/{z}/{x}/{y}.png"; empty: none
    std::string attribution; ///< shown beside the map, as the tiles' licence asks
};

/// Throws ise::error (invalid_argument) where it is no http or https URL with {z}, {x} and {y}, or has characters that
/// a policy or an address cannot have.
void check(const tile_source& tiles);

/// "https://tiles.example.org": what the page's policy lets the browser load pictures from.
std::string origin_of(std::string_view url);

} // namespace atirma
