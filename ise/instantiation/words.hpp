#pragma once
#include <ise/core/readable.hpp>

#include <algorithm>
#include <string>
#include <string_view>

namespace ise::instantiation {

/// As much of what others wrote as belongs into a message.
inline std::string shown(std::string_view text) { return readable(text, 80); }

/// "wind-speed": what follows two dashes can be nothing else.
inline bool is_word(std::string_view text) {
    auto good = [](unsigned char letter) {
        return (letter >= 'a' && letter <= 'z') || (letter >= '0' && letter <= '9') || letter == '-' || letter == '_';
    };
    return !text.empty() && text.size() <= 64 && text.front() != '-' && std::ranges::all_of(text, good);
}

} // namespace ise::instantiation
