#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/stream.hpp>

#include <memory>
#include <string>
#include <utility>

namespace ise {

/// Two connected in-process streams (each an `object_stream`), the first for use on `near`, the second on `far`, which
/// may run on other threads. Each direction holds up to `capacity_bytes` that the other side has not read.
///
/// Each side is made, used and destroyed on its own loop (or anywhere once that loop has ended); the other
/// side may outlive it and its loop. Closing one side gives the other what was written, then end of stream;
/// its writes fail with `broken_pipe`. Objects that nobody took are destroyed by the side that goes, on its thread.
std::pair<std::unique_ptr<stream>, std::unique_ptr<stream>> make_inproc_pair(loop& near, loop& far, std::string name,
                                                                             std::size_t capacity_bytes = 256 * 1024);

} // namespace ise
