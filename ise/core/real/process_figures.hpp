#pragma once
#include <cstdint>
#include <optional>

namespace ise {

/// This process, as the operating system counts it.
struct process_figures {
    double processor_seconds = 0;     ///< user and system
    double began = 0;                 ///< in seconds since 1970-01-01 UTC
    std::uint64_t virtual_bytes = 0;  ///< address space
    std::uint64_t resident_bytes = 0; ///< physical memory
    std::uint64_t open_descriptors = 0;
    std::uint64_t max_descriptors = 0; ///< the soft limit
    std::uint64_t threads = 0;
};

/// Nothing where there is no /proc.
std::optional<process_figures> figures_of_this_process();

} // namespace ise
