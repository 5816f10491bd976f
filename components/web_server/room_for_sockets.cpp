#include <components/web_server/room_for_sockets.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

#if defined(__unix__)
#include <sys/resource.h>
#endif

namespace atirma {

std::string make_room_for_sockets([[maybe_unused]] std::size_t sockets) {
#if defined(__unix__)
    constexpr rlim_t others = 256; // databases, sessions with other components, logs
    const rlim_t wanted = static_cast<rlim_t>(sockets) + others;
    rlimit now{};
    if (::getrlimit(RLIMIT_NOFILE, &now) != 0 || now.rlim_cur == RLIM_INFINITY || now.rlim_cur >= wanted) return {};
    now.rlim_cur = now.rlim_max == RLIM_INFINITY ? wanted : std::min(wanted, now.rlim_max);
    bool raised = ::setrlimit(RLIMIT_NOFILE, &now) == 0;
    if (raised && now.rlim_cur >= wanted) return {};
    return fmt::format("this process may open {} files, too few for {} viewers: raise the limit (ulimit -Hn, or "
                       "LimitNOFILE= of systemd)",
                       static_cast<std::uint64_t>(now.rlim_cur), sockets);
#else
    return {};
#endif
}

} // namespace atirma
