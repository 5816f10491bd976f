#include <ise/transport/system_streams.hpp>

namespace ise {

constinit const transport transports::tcp{
    .scheme = "tcp",
    .example = "tcp://127.0.0.1:7400, tcp://[::1]:0",
    .rank = 100,
    .by_default = true,
    .connect = net::connect_sealed,
    .listen = net::listen_sealed,
};

} // namespace ise
