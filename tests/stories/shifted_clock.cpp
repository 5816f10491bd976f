// Loaded before a program (LD_PRELOAD): its wall clock is STORY_CLOCK_SHIFT_S seconds off, its monotonic clock is
// right.
#include <cstdlib>
#include <ctime>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

namespace {

time_t shift() {
    static const time_t seconds = [] {
        const char* text = std::getenv("STORY_CLOCK_SHIFT_S");
        return static_cast<time_t>(text ? std::atoll(text) : 0);
    }();
    return seconds;
}

} // namespace

extern "C" {

int clock_gettime(clockid_t which, timespec* out) noexcept {
    auto failed = static_cast<int>(::syscall(SYS_clock_gettime, which, out));
    if (failed == 0 && which == CLOCK_REALTIME) out->tv_sec += shift();
    return failed;
}
int gettimeofday(timeval* out, void*) noexcept {
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    *out = {now.tv_sec, now.tv_nsec / 1000};
    return 0;
}
time_t time(time_t* out) noexcept {
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    if (out) *out = now.tv_sec;
    return now.tv_sec;
}
}
