#pragma once

namespace ise::sim {

/// How a process came to its end.
enum class ending {
    stop,      ///< by itself: its sockets are closed in order
    crash,     ///< at once: its host resets its connections
    host_lost, ///< with its host: nobody is told
};

/// Something of a process that its host knows, such as a socket: it ends with the process.
class resource {
public:
    virtual ~resource() = default;
    virtual void end(ending how) = 0;
};

} // namespace ise::sim
