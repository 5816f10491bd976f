#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace atirma {

/// A boat that the page shows.
struct boat_source {
    std::string name;
    std::string id; ///< in its addresses: a-z, 0-9, '-'; see `address_of`
    /// Paths of the proxies whose `telemetry` is shown, or the role of the communication nodes.
    std::vector<std::string> telemetry;
};

/// "Vela II=vela/communication" or "Vela=vela/shore/xbee,vela/shore/gprs". Throws ise::error (invalid_argument) for a
/// text that is no such thing.
boat_source parse_boat(std::string_view text);

/// "Vela II" → "vela-ii". Empty where no letter or digit is left.
std::string address_of(std::string_view name);

/// Gives each boat its address. Throws ise::error (invalid_argument) where two have the same one, or one has none or
/// that of a part of the page.
void name_boats(std::vector<boat_source>& boats);

} // namespace atirma
