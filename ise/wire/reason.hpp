#pragma once
#include <cstddef>
#include <string>

namespace ise::wire {

/// The text of a failure that is sent to a peer has at most this many bytes (FORMAT.md, "Codes").
inline constexpr std::size_t reason_bytes = 4096;

/// The beginning of a text of UTF-8, as much as may be sent: whole characters.
inline std::string reason_of(const std::string& message) {
    if (message.size() <= reason_bytes) return message;
    auto size = reason_bytes;
    while (size > 0 && (static_cast<unsigned char>(message[size]) & 0xC0) == 0x80) --size;
    return message.substr(0, size);
}

} // namespace ise::wire
