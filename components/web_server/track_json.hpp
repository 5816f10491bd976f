#pragma once
// The page's JSON. Private to the .cpp files of this folder: it shows nlohmann-json.
#include <components/web_server/track_line.hpp>
#include <components/web_server/track_updates.hpp>

#include <nlohmann/json.hpp>

#include <string>
#include <string_view>

namespace atirma {

using nlohmann::json;

double rounded(double value, int decimals);
/// What a bad byte in a text would break: JSON keys are not repaired by `to_text`.
std::string printable(std::string_view text);

json to_json(utc_ms at); ///< milliseconds since 1970
json to_json(const position_update& update);
json to_json(const navigation_update& update);
json to_json(const wind_update& update);
json to_json(const power_update& update);
json to_json(const waypoints_update& update);
json to_json(const mode_update& update);
json to_json(const feed_update& update);
/// A row of numbers in the order of `track_columns`.
json to_json(const track_point& point);
json track_columns();

/// One line; bytes that are no UTF-8 become U+FFFD.
std::string to_text(const json& value);

} // namespace atirma
