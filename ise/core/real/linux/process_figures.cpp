#include <ise/core/real/process_figures.hpp>

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace ise {
namespace {

// Seconds since 1970 at which the machine was started.
double boot_time() {
    std::ifstream in("/proc/stat");
    for (std::string word; in >> word;) {
        double at = 0;
        if (word == "btime" && in >> at) return at;
    }
    return 0;
}

} // namespace

std::optional<process_figures> figures_of_this_process() {
    std::ifstream in("/proc/self/stat");
    std::string line;
    if (!std::getline(in, line)) return std::nullopt;
    auto behind_name = line.rfind(')'); // the name may contain anything
    if (behind_name == line.npos) return std::nullopt;
    std::istringstream fields(line.substr(behind_name + 1));
    std::string skipped;
    double user = 0, system = 0, start = 0;
    std::uint64_t pages = 0;
    process_figures made;
    for (int at = 3; at < 14; ++at) fields >> skipped; // proc(5) counts from 1
    fields >> user >> system;                          // 14 and 15
    for (int at = 16; at < 20; ++at) fields >> skipped;
    fields >> made.threads >> skipped >> start >> made.virtual_bytes >> pages; // 20 to 24
    if (!fields) return std::nullopt;
    const auto ticks = static_cast<double>(::sysconf(_SC_CLK_TCK));
    made.processor_seconds = (user + system) / ticks;
    made.began = boot_time() + start / ticks;
    made.resident_bytes = pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
    std::error_code problem;
    for (auto each = std::filesystem::directory_iterator("/proc/self/fd", problem);
         !problem && each != std::filesystem::directory_iterator(); each.increment(problem))
        ++made.open_descriptors;
    rlimit most{};
    if (::getrlimit(RLIMIT_NOFILE, &most) == 0) made.max_descriptors = most.rlim_cur;
    return made;
}

} // namespace ise
