#include <ise/core/real/system.hpp>

#include <fmt/format.h>

#include <array>
#include <fstream>
#include <random>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <pthread.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

namespace ise::real {
namespace {

std::string first_line_of(const char* path) {
    std::ifstream file(path);
    std::string line;
    std::getline(file, line);
    return line;
}

} // namespace

void draw_random(std::span<std::uint64_t> into) {
    if (::getrandom(into.data(), into.size_bytes(), 0) == static_cast<ssize_t>(into.size_bytes())) return;
    std::random_device source;
    for (auto& value : into) value = std::uint64_t{source()} << 32 | source();
}

process_identity this_process() {
    process_identity made;
    std::array<char, 256> name{};
    ::gethostname(name.data(), name.size() - 1);
    made.host_name = name.data();
    struct stat network {};
    ::stat("/proc/self/ns/net", &network);
    made.host_key = fmt::format("{}.{}", first_line_of("/proc/sys/kernel/random/boot_id"), network.st_ino);
    made.process_id = static_cast<std::uint64_t>(::getpid());
    std::uint64_t life = 0;
    draw_random({&life, 1});
    made.process_key = fmt::format("{}.{:016x}", made.process_id, life);
    return made;
}

[[gnu::hot]] time_point recent_time() {
    timespec at{};
    clock_gettime(CLOCK_MONOTONIC_COARSE, &at);
    return time_point(std::chrono::seconds(at.tv_sec) + std::chrono::nanoseconds(at.tv_nsec));
}

std::vector<std::string> interface_addresses() {
    std::vector<std::string> found;
    ifaddrs* first = nullptr;
    if (::getifaddrs(&first) != 0) return found;
    for (auto* entry = first; entry; entry = entry->ifa_next) {
        if (!entry->ifa_addr || !(entry->ifa_flags & IFF_UP)) continue;
        std::array<char, INET6_ADDRSTRLEN> text{};
        if (entry->ifa_addr->sa_family == AF_INET) {
            ::inet_ntop(AF_INET, &reinterpret_cast<sockaddr_in*>(entry->ifa_addr)->sin_addr, text.data(), text.size());
        } else if (entry->ifa_addr->sa_family == AF_INET6) {
            auto* address = reinterpret_cast<sockaddr_in6*>(entry->ifa_addr);
            if (IN6_IS_ADDR_LINKLOCAL(&address->sin6_addr)) continue; // useless without a scope
            ::inet_ntop(AF_INET6, &address->sin6_addr, text.data(), text.size());
        } else {
            continue;
        }
        found.emplace_back(text.data());
    }
    ::freeifaddrs(first);
    return found;
}

void name_thread(std::thread& thread, const std::string& name) {
    ::pthread_setname_np(thread.native_handle(), name.substr(0, 15).c_str());
}

} // namespace ise::real
