#pragma once
#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <string_view>

// How the boats of a fleet are called (docs/fleet.md). A boat is a namespace: its name is its id on the links, too.
namespace atirma {

/// The first boat of a fleet, and the only one elsewhere.
inline constexpr std::string_view first_boat = "atirma";

/// The boats of a fleet by number, from 1: "atirma", "boat-2", "boat-3"…
inline std::string boat_name(std::size_t number) {
    return number <= 1 ? std::string(first_boat) : fmt::format("boat-{}", number);
}

/// A value as the first boat has it, for another boat: "atirma" → "boat-2", "atirma/shore/gprs" → "boat-2/shore/gprs",
/// "gprs=atirma/shore/gprs" → "gprs=boat-2/shore/gprs"; `{boat}` becomes the name anywhere, of the first boat too.
inline std::string of_boat(std::string text, std::string_view boat) {
    auto begin = text.find('=');
    begin = begin == std::string::npos ? 0 : begin + 1;
    auto end = begin + first_boat.size();
    if (text.compare(begin, first_boat.size(), first_boat) == 0 && (end == text.size() || text[end] == '/'))
        text.replace(begin, first_boat.size(), boat);
    constexpr std::string_view mark = "{boat}";
    for (std::size_t at = 0; (at = text.find(mark, at)) != std::string::npos; at += boat.size())
        text.replace(at, mark.size(), boat);
    return text;
}

} // namespace atirma
