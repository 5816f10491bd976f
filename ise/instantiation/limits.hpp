#pragma once
#include <ise/core/result.hpp>

#include <cstdint>
#include <string>
#include <string_view>

namespace ise::instantiation {

/// What an instance may use of its host, together with all processes that it starts. A packet: fields are only ever
/// appended.
struct resource_limits {
    static constexpr std::uint32_t default_pids = 256;

    std::uint32_t pids = default_pids; ///< processes and threads
    std::uint64_t memory = 0;          ///< bytes; 0: no limit
    double cpus = 0;                   ///< processors, such as 0.5; 0: no limit

    bool operator==(const resource_limits&) const = default;
};

/// Sets one limit from text: "pids" and "64", "memory" and "256 MiB", "cpus" and "0.5". errc::invalid_argument says
/// what is allowed.
result<void> set_limit(resource_limits& of, std::string_view name, std::string_view text);
/// errc::invalid_argument if one of them is out of its range.
result<void> check(const resource_limits& limits);
/// "pids=64 memory=256MiB"
std::string as_text(const resource_limits& limits);

} // namespace ise::instantiation
