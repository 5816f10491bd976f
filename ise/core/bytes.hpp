#pragma once
#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace ise {

/// Owned raw bytes, such as an encoded packet.
using bytes = std::vector<std::byte>;

/// Borrowed raw bytes; the creator of the view keeps the memory alive.
using bytes_view = std::span<const std::byte>;

/// The bytes of a text, borrowed.
inline bytes_view as_bytes(std::string_view text) noexcept {
    return {reinterpret_cast<const std::byte*>(text.data()), text.size()};
}

/// Bytes as a text, borrowed; whether they are UTF-8 is not checked.
inline std::string_view as_text(bytes_view raw) noexcept {
    return {reinterpret_cast<const char*>(raw.data()), raw.size()};
}

} // namespace ise
