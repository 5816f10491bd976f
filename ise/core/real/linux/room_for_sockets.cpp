#include <ise/core/real/room_for_sockets.hpp>

#include <algorithm>

#include <sys/resource.h>

namespace ise {

std::size_t room_for_sockets(std::size_t wanted) {
    constexpr rlim_t others = 256; // databases, sessions with other components, logs
    const rlim_t needed = static_cast<rlim_t>(wanted) + others;
    rlimit now{};
    if (::getrlimit(RLIMIT_NOFILE, &now) != 0 || now.rlim_cur == RLIM_INFINITY || now.rlim_cur >= needed) return wanted;
    auto raised = now;
    raised.rlim_cur = now.rlim_max == RLIM_INFINITY ? needed : std::min(needed, now.rlim_max);
    if (::setrlimit(RLIMIT_NOFILE, &raised) == 0) now = raised;
    if (now.rlim_cur >= needed) return wanted;
    return std::min(
        wanted, static_cast<std::size_t>(std::max(now.rlim_cur / 2, now.rlim_cur - std::min(others, now.rlim_cur))));
}

} // namespace ise
