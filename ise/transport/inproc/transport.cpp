#include <ise/transport/system_streams.hpp>

namespace ise {

constinit const transport transports::inproc{
    .scheme = "inproc",
    .example = "inproc://name",
    .address = address_form::name,
    .rank = 0,
    .same_host = true,
    .same_process = true,
    .needs_descriptors = false,
    .by_default = true,
    .connect = net::connect_by_environment,
    .listen = net::listen_by_environment,
};

} // namespace ise
