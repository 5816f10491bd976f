#pragma once
#include <ise/packet/dynamic.hpp>

namespace ise {

/// The bytes of a packet in the layout of a service's type, without a copy where it has that already. Throws
/// `type_mismatch` with the difference. The packet outlives it.
class fitted_bytes {
public:
    fitted_bytes(const dynamic_packet& packet, const schema& type) : view_(packet.encoded()) {
        if (packet.type().fingerprint() == type.fingerprint()) return;
        adapted_ = adapt(packet.type(), type, view_);
        view_ = adapted_;
    }
    fitted_bytes(const fitted_bytes&) = delete;
    fitted_bytes& operator=(const fitted_bytes&) = delete;

    const bytes_view& view() const noexcept { return view_; }
    bytes copy() const { return bytes(view_.begin(), view_.end()); }

private:
    bytes adapted_;
    bytes_view view_;
};

} // namespace ise
