#pragma once
#include <algorithm>
#include <string>
#include <string_view>

namespace ise::instantiation {

/// As much of what others wrote as belongs into a message.
inline std::string shown(std::string_view text) {
    std::string made;
    for (char letter : text.substr(0, 80))
        made += static_cast<unsigned char>(letter) < 0x20 || letter == 0x7F ? '?' : letter;
    return made;
}

/// "wind-speed": what follows two dashes can be nothing else.
inline bool is_word(std::string_view text) {
    auto good = [](unsigned char letter) {
        return (letter >= 'a' && letter <= 'z') || (letter >= '0' && letter <= '9') || letter == '-' || letter == '_';
    };
    return !text.empty() && text.size() <= 64 && text.front() != '-' && std::ranges::all_of(text, good);
}

} // namespace ise::instantiation
