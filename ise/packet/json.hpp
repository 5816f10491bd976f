#pragma once
#include <ise/core/bytes.hpp>
#include <ise/packet/schema.hpp>

#include <string>
#include <string_view>

namespace ise {

/// The layout of JSON text.
enum class json_style {
    compact, ///< one line
    pretty,  ///< indented by two
};

/// Limits on JSON text, which may come from untrusted sources.
struct json_limits {
    std::size_t max_text_bytes = std::size_t{16} << 20;    ///< of the JSON
    std::size_t max_depth = 64;                            ///< of lists and objects
    std::size_t max_packet_bytes = std::size_t{256} << 20; ///< of the packet made of it
};

/// A packet's bytes as JSON. LAYOUT.md defines the JSON of each type: enumerators by name, time points in ISO 8601
/// (UTC), durations in seconds, chars as text, bytes and opaque types as base64, a variant as {"index": …, "value": …}.
/// Throws `malformed` with the field if the bytes do not match, `too_large` if the text exceeds `max_json_bytes`.
std::string to_json(const schema& of, bytes_view packet, json_style style = json_style::compact,
                    std::size_t max_json_bytes = std::size_t{512} << 20);

/// JSON as a packet's bytes. Missing fields take the schema's defaults.
/// Throws `malformed` with the path (`waypoints[3].latitude_deg: expected a number`); for an unknown field it
/// names the nearest known one. Throws `too_large` beyond the limits.
bytes from_json(const schema& of, std::string_view json, const json_limits& limits = {});

/// A typed packet as JSON.
template <class T>
requires packet<T> std::string to_json(const T& value, json_style style = json_style::compact) {
    return to_json(schema_of<T>(), encode(value), style);
}

/// JSON as a typed packet; throws as above.
template <class T>
T from_json(std::string_view json) {
    return decode<T>(from_json(schema_of<T>(), json));
}

} // namespace ise
