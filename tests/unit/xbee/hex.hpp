#pragma once
#include <ise/core/bytes.hpp>

#include <string>

/// Bytes of "7E 00 04"; spaces are ignored.
inline ise::bytes hex(const std::string& text) {
    ise::bytes out;
    std::string pair;
    for (char c : text) {
        if (c == ' ') continue;
        pair += c;
        if (pair.size() < 2) continue;
        out.push_back(static_cast<std::byte>(std::stoul(pair, nullptr, 16)));
        pair.clear();
    }
    return out;
}
