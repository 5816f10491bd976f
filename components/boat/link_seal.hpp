#pragma once
#include <components/boat/packet_header.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace atirma {

/// How a proxy's link is sealed (components/seal).
struct link_seal {
    bool sealed = false;                    ///< the proxy has a key of the radio; if not, the rest is empty
    std::uint8_t epoch = 0;                 ///< of the key in use
    std::string key;                        ///< its fingerprint
    std::optional<std::uint8_t> next_epoch; ///< a key that the boat is to change to, and has not used yet
    std::optional<utc_time> verified_at;    ///< the last packet of the boat with a good tag, by the proxy's clock
    std::uint64_t refused = 0;              ///< packets without a good tag: dropped
};

} // namespace atirma
