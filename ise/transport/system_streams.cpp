#include <ise/transport/system_streams.hpp>

#include <ise/core/loop.hpp>

namespace ise::net {

task<result<std::unique_ptr<stream>>> connect_by_environment(loop& on, endpoint to, security) {
    return on.env().connect(on, std::move(to));
}

result<std::unique_ptr<listener>> listen_by_environment(loop& on, const endpoint& at, security) {
    return on.env().listen(on, at);
}

} // namespace ise::net
