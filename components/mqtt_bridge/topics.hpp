#pragma once
#include <ise/core/result.hpp>

#include <cstddef>
#include <string>
#include <string_view>

/// Names of ISE as MQTT topics. Pure.
namespace ise::mqtt {

inline constexpr std::size_t max_prefix_bytes = 200;
inline constexpr std::size_t max_topic_bytes = 2048;

/// A text as a part of a topic: `+`, `#`, `%`, control characters and all bytes beyond ASCII become %XX; a `/` too,
/// unless `levels`.
std::string escape(std::string_view text, bool levels);
/// The reverse. errc::malformed for a `%` without two hexadecimal digits, and for characters that `escape` replaces.
result<std::string> unescape(std::string_view text);

/// Whether it can begin topics: errc::invalid_argument if it is empty or too long, begins with `$`, begins or ends with
/// `/`, or has wildcards or other characters than printable ASCII.
result<void> check_prefix(std::string_view prefix);

/// A service of a component.
struct service_place {
    std::string path;
    std::string service;
};

/// "PREFIX/KIND/PATH/SERVICE". errc::too_large beyond `max_topic_bytes`.
result<std::string> topic_of(std::string_view prefix, std::string_view kind, const service_place& of);
/// The reverse; errc::malformed with the reason for a topic that `topic_of` cannot have made.
result<service_place> read_topic(std::string_view prefix, std::string_view kind, std::string_view topic);

} // namespace ise::mqtt
