#pragma once
#include "support/report.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <string>
#include <thread>

/// What the drivers of other middlewares share: the interface of a benchmark program (bench/README.md) around what only
/// they can do.
namespace bench {

/// Parses the command line, serves or measures, and gives the exit code. What throws std::invalid_argument is not
/// offered.
int peer_main(int argc, char** argv, const char* name, const std::function<void(const options&)>& serve,
              const std::function<outcome(const options&)>& measure);

/// Throws unless the transport and the kind are what such a peer has: kind is its name, or `raw` (the default).
void expect(const options& asked, const char* name, std::initializer_list<const char*> transports);

/// The latency of `call`, one after the other.
template <class Call>
outcome one_by_one(const options& asked, Call call) {
    outcome out;
    const auto begin = now_ns() + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    const auto end = begin + static_cast<std::int64_t>(asked.seconds * 1e9);
    for (auto before = now_ns(); before < end;) {
        call();
        const auto after = now_ns();
        if (before >= begin) {
            out.latency.add(after - before);
            out.seconds += static_cast<double>(after - before) * 1e-9;
        }
        before = after;
    }
    out.count = out.latency.samples();
    return out;
}

/// What was counted between the end of the warm-up and the end, by whichever threads count; sleeps in between.
template <class Count>
outcome rate_of(const options& asked, Count count) {
    const auto pause = [](double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); };
    outcome out;
    pause(asked.warmup_seconds);
    const auto began = now_ns();
    const std::uint64_t before = count();
    pause(asked.seconds);
    out.count = count() - before;
    out.seconds = static_cast<double>(now_ns() - began) * 1e-9;
    return out;
}

/// The same by the thread that does the work: `step()` does some of it and gives how much.
template <class Step>
outcome rate_by(const options& asked, Step step) {
    outcome out;
    const auto begin = now_ns() + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    const auto end = begin + static_cast<std::int64_t>(asked.seconds * 1e9);
    while (now_ns() < begin) step();
    const auto began = now_ns();
    auto at = began;
    for (; at < end; at = now_ns()) out.count += step();
    out.seconds = static_cast<double>(at - began) * 1e-9;
    return out;
}

/// Latencies from stamps, by `paced` receivers: those after the warm-up count.
class pace {
public:
    explicit pace(const options& asked)
        : begin_(now_ns() + static_cast<std::int64_t>(asked.warmup_seconds * 1e9)),
          end_(begin_ + static_cast<std::int64_t>(asked.seconds * 1e9)) {}
    void take(const void* packet) {
        std::int64_t stamp = 0;
        __builtin_memcpy(&stamp, packet, sizeof stamp);
        const auto now = now_ns();
        if (now >= begin_ && now < end_) out_.latency.add(now - stamp);
    }
    bool over() const { return now_ns() >= end_; }
    outcome result() {
        out_.count = out_.latency.samples();
        out_.seconds = static_cast<double>(end_ - begin_) * 1e-9;
        return out_;
    }

private:
    outcome out_;
    std::int64_t begin_, end_;
};

/// Calls `publish(packet)` once a millisecond with the time in its first bytes, as long as it returns true.
template <class Publish>
void once_a_millisecond(std::string packet, Publish publish) {
    for (auto next = std::chrono::steady_clock::now();; next += std::chrono::milliseconds(1)) {
        std::this_thread::sleep_until(next);
        const auto now = now_ns();
        __builtin_memcpy(packet.data(), &now, sizeof now);
        if (!publish(packet)) return;
    }
}

} // namespace bench
