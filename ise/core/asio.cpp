// Asio is compiled once, here (ASIO_SEPARATE_COMPILATION).
#include <ise/core/asio_configuration.hpp>

#include <asio/impl/src.hpp>

namespace ise::detail {

const char ISE_ASIO_CONFIGURATION = 0;

} // namespace ise::detail
