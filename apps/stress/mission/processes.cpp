#include "processes.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <unistd.h>

namespace atirma::stress {

void measure(sample& into, const std::set<std::uint64_t>& processes) {
    const auto page_kib = static_cast<std::size_t>(sysconf(_SC_PAGESIZE) / 1024);
    for (auto id : processes) {
        std::size_t whole = 0, resident = 0;
        std::ifstream status(fmt::format("/proc/{}/statm", id));
        if (!(status >> whole >> resident)) continue;
        ++into.processes;
        into.resident_kib += resident * page_kib;
        std::error_code problem;
        std::filesystem::directory_iterator open(fmt::format("/proc/{}/fd", id), problem);
        if (!problem) into.descriptors += static_cast<std::size_t>(std::distance(open, {}));
    }
}

} // namespace atirma::stress
