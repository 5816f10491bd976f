#include <ise/core/transport.hpp>
#include <ise/transport/shm/row.hpp>
#include <ise/transport/udp/certified.hpp>

// The table of transports. A new one is a folder beside this file and a line here; a row that other code does not name
// is declared in a header of its folder.
namespace ise {

std::span<const transport* const> built_in_transports() noexcept {
    static constexpr const transport* rows[] = {
        &transports::tcp,   &transports::udp, &transports::tls,    &transports::udp_tls,
        &transports::local, &transports::shm, &transports::inproc,
    };
    return rows;
}

} // namespace ise
