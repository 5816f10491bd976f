#include <ise/core/real/process_figures.hpp>

#include <windows.h>

#include <psapi.h>

namespace ise {
namespace {

double seconds_of(FILETIME time) noexcept {
    return static_cast<double>(std::uint64_t{time.dwHighDateTime} << 32 | time.dwLowDateTime) / 1e7;
}

} // namespace

// Windows counts no threads of one process without a list of all, and handles have no limit of their own.
std::optional<process_figures> figures_of_this_process() {
    constexpr double from_1601_to_1970 = 11'644'473'600.0;
    process_figures made;
    FILETIME began, ended, kernel, user;
    PROCESS_MEMORY_COUNTERS_EX memory{};
    DWORD handles = 0;
    const auto self = ::GetCurrentProcess();
    if (!::GetProcessTimes(self, &began, &ended, &kernel, &user) ||
        !::GetProcessMemoryInfo(self, reinterpret_cast<PROCESS_MEMORY_COUNTERS*>(&memory), sizeof memory) ||
        !::GetProcessHandleCount(self, &handles))
        return std::nullopt;
    made.processor_seconds = seconds_of(kernel) + seconds_of(user);
    made.began = seconds_of(began) - from_1601_to_1970;
    made.virtual_bytes = memory.PrivateUsage;
    made.resident_bytes = memory.WorkingSetSize;
    made.open_descriptors = handles;
    return made;
}

} // namespace ise
