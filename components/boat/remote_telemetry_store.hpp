#pragma once
#include <components/boat/telemetry_store.hpp>

#include <ise/service/remote.hpp>

namespace atirma {

/// The store of the communication nodes: a packet is safe once the holder of the role says that it is on disk, at the
/// other node too while that lives. Used on the loop of the component that made `nodes`.
class remote_telemetry_store final : public telemetry_store {
public:
    explicit remote_telemetry_store(ise::remote nodes) : nodes_(std::move(nodes)) {}

    /// Throws what the call ends with: nobody serves the role, its disk is full. Nothing is known to be kept then.
    ise::task<> keep(std::vector<telemetry_packet> packets) override;

private:
    ise::remote nodes_;
};

} // namespace atirma
