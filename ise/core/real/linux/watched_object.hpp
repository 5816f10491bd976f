#pragma once
#include <asio/posix/stream_descriptor.hpp>

namespace ise::real {

using watched_object = asio::posix::stream_descriptor;

} // namespace ise::real
