#include "report.hpp"

#include <cstdio>
#include <ctime>
#include <thread>
#include <unistd.h>

namespace bench {

void print_latency(const histogram& latency) {
    if (latency.samples() == 0) {
        std::printf("null");
        return;
    }
    std::printf(
        "{\"samples\":%llu,\"mean\":%.1f,\"p50\":%.1f,\"p90\":%.1f,\"p99\":%.1f,\"p999\":%.1f,\"max\":%llu,\"at\":[",
        static_cast<unsigned long long>(latency.samples()), latency.mean_ns(), latency.quantile_ns(0.5),
        latency.quantile_ns(0.9), latency.quantile_ns(0.99), latency.quantile_ns(0.999),
        static_cast<unsigned long long>(latency.max_ns()));
    const char* between = "";
    for (double share :
         {0.001, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 0.9998, 0.9999}) {
        std::printf("%s[%g,%.0f]", between, share, latency.quantile_ns(share));
        between = ",";
    }
    std::printf("]}");
}

void print(const options& asked, const outcome& found) {
    if (asked.work == "idle") {
        std::printf(
            "{\"work\":\"idle\",\"kind\":\"%s\",\"transport\":\"%s\",\"connections\":%llu,\"heap_bytes_each\":%.0f,"
            "\"resident_bytes_each\":%.0f,\"latency_ns\":",
            asked.kind.c_str(), asked.transport.c_str(), static_cast<unsigned long long>(found.count), found.bytes_each,
            found.resident_bytes_each);
        print_latency(found.latency);
        std::printf("}\n");
        std::fflush(stdout);
        return;
    }
    const auto per_s = found.seconds > 0 ? static_cast<double>(found.count) / found.seconds : 0;
    std::printf("{\"work\":\"%s\",\"kind\":\"%s\",\"transport\":\"%s\",\"size_bytes\":%zu,\"outstanding\":%zu,"
                "\"subscribers\":%zu,"
                "\"seconds\":%.6f,\"count\":%llu,\"per_s\":%.1f,\"latency_ns\":",
                asked.work.c_str(), asked.kind.c_str(), asked.transport.c_str(), asked.size_bytes, asked.outstanding,
                asked.subscribers, found.seconds, static_cast<unsigned long long>(found.count), per_s);
    print_latency(found.latency);
    std::printf("}\n");
    std::fflush(stdout);
}

std::int64_t now_ns() noexcept {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now); // the same clock in both processes
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

void end_with_standard_input() {
    std::thread([] {
        char ignored[64];
        while (::read(STDIN_FILENO, ignored, sizeof ignored) > 0) {}
        ::_exit(0);
    }).detach();
}

void announce(const std::string& address) {
    std::printf("%s\n", address.c_str());
    std::fflush(stdout);
}

} // namespace bench
