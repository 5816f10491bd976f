#include <ise/core/transport.hpp>
#include <ise/transport/udp/certified.hpp>

// The table in the place of table.cpp, for systems without sockets of files that pass descriptors.
namespace ise {

std::span<const transport* const> built_in_transports() noexcept {
    static constexpr const transport* rows[] = {
        &transports::tcp, &transports::udp, &transports::tls, &transports::udp_tls, &transports::inproc,
    };
    return rows;
}

} // namespace ise
