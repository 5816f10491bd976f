#pragma once
#include <ise/core/transport.hpp>

#include <string>
#include <vector>

namespace ise_test {

/// Whether this system has local sockets, over which processes share memory too. Windows knows their scheme only.
inline bool has_local_sockets() noexcept { return ise::protocol::local->by_default; }

/// These endpoints without those that need local sockets where the system has none.
inline std::vector<std::string> usable_here(std::vector<std::string> endpoints) {
    if (!has_local_sockets())
        std::erase_if(endpoints,
                      [](const std::string& one) { return one.starts_with("local:") || one.starts_with("shm:"); });
    return endpoints;
}

} // namespace ise_test
