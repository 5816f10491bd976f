#pragma once
#include <ise/core/transport.hpp>

namespace ise::transports {

/// udp whose sides show certificates, as `tls` is for tcp (FORMAT.md, section 18).
extern const transport udp_tls;

} // namespace ise::transports
