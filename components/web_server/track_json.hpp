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
/// `{"at":[1,[…]],"latitude_deg":[1000000,[…]],…}`: of each of `track_columns` the number that its values are
/// multiplied with to be whole, and then the differences; null where there is no value.
void append_columns(std::string& to, const std::vector<track_point>& points);
/// `{"at":[1,[…]],"value":[100,[…]]}`
void append_history(std::string& to, const std::vector<std::pair<utc_ms, double>>& values);

/// One line; bytes that are no UTF-8 become U+FFFD.
std::string to_text(const json& value);

} // namespace atirma
