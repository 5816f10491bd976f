#include <ise/transport/system_streams.hpp>

namespace ise {

constinit const transport transports::local{
    .scheme = "local",
    .example = "local:///path/of.sock, local://@name",
    .address = address_form::file_or_name,
    .rank = 50,
    .same_host = true,
    .by_default = true,
    .connect = net::connect_sealed,
    .listen = net::listen_sealed,
};

} // namespace ise
