#pragma once
#include <components/boat/services.hpp>

#include <ise/core/task.hpp>

#include <vector>

namespace atirma {

/// Where telemetry is safe. A link that acknowledges tells the boat only then that it may forget a packet.
class telemetry_store {
public:
    virtual ~telemetry_store() = default;

    /// Completes once all of them are safe; a packet may come again. On the proxy's loop, one call at a time. What it
    /// throws is shown as the link's trouble, the packets stay with the proxy, and it is called again. Cancellation:
    /// terminal.
    virtual ise::task<> keep(std::vector<telemetry_packet> packets) = 0;
};

} // namespace atirma
