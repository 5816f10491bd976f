#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>

namespace ise::detail {

inline constexpr bool little_endian_machine = std::endian::native == std::endian::little;

template <class T>
inline void store_little(std::byte* to, T value) noexcept {
    std::memcpy(to, &value, sizeof(T));
    if constexpr (!little_endian_machine) std::reverse(to, to + sizeof(T));
}

template <class T>
inline T load_little(const std::byte* from) noexcept {
    T value;
    if constexpr (little_endian_machine) {
        std::memcpy(&value, from, sizeof(T));
    } else {
        std::array<std::byte, sizeof(T)> turned;
        std::reverse_copy(from, from + sizeof(T), turned.begin());
        std::memcpy(&value, turned.data(), sizeof(T));
    }
    return value;
}

} // namespace ise::detail
