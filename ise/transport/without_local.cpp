#include <ise/transport/system_streams.hpp>
#include <ise/transport/udp/certified.hpp>

// In the place of table.cpp and local/, for systems without sockets of files that pass descriptors. Their scheme is
// known, since peers and the virtual world use it; components listen there if told to, and the environment refuses.
namespace ise {

constinit const transport transports::local{
    .scheme = "local",
    .example = "local:///path/of.sock, local://@name",
    .address = address_form::file_or_name,
    .rank = 50,
    .same_host = true,
    .connect = net::connect_sealed,
    .listen = net::listen_sealed,
};

std::span<const transport* const> built_in_transports() noexcept {
    static constexpr const transport* rows[] = {
        &transports::tcp,     &transports::udp,   &transports::tls,
        &transports::udp_tls, &transports::local, &transports::inproc,
    };
    return rows;
}

} // namespace ise
