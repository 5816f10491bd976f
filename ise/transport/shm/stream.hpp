#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/result.hpp>
#include <ise/core/stream.hpp>
#include <ise/transport/shm/memory.hpp>

#include <memory>
#include <string>

namespace ise::net::shm {

/// One end of a connection through shared memory: a ring in each direction, a bell for whoever sleeps, and the local
/// socket over which both sides agreed, whose end says that the peer is gone.
struct ends {
    owned_fd socket;
    owned_fd own_bell;  ///< rung by the peer
    owned_fd peer_bell; ///< rings the peer
    mapping memory;
    bool connecting = false; ///< this side connected
};

/// A stream over it. Errors: errc::io_failed (the loop cannot watch one more descriptor).
result<std::unique_ptr<stream>> make_stream(loop& on, ends over, std::string peer);

} // namespace ise::net::shm
