#pragma once
#include <cstdint>
#include <string_view>

namespace ise {

/// FNV-1a with 64 bits, finished by the mixer of MurmurHash3 (fmix64): simple to write again in any language.
constexpr std::uint64_t fingerprint_of(std::string_view text) noexcept {
    std::uint64_t hash = 0xcbf29ce484222325u;
    for (char c : text) {
        hash ^= static_cast<unsigned char>(c);
        hash *= 0x100000001b3u;
    }
    hash ^= hash >> 33;
    hash *= 0xff51afd7ed558ccdu;
    hash ^= hash >> 33;
    hash *= 0xc4ceb9fe1a85ec53u;
    hash ^= hash >> 33;
    return hash;
}

} // namespace ise
