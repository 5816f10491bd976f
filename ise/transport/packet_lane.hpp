#pragma once
#include <ise/core/bytes.hpp>
#include <ise/packet/shared_bytes.hpp>
#include <ise/wire/frame.hpp>

#include <cstdint>

namespace ise::net {

/// Where a connection puts packets that need not arrive: beside its stream, as messages of their own.
class packet_lane {
public:
    /// Whether one more packet should be put now. Where not, whoever asked is told when it is time again.
    virtual bool wanted() noexcept = 0;
    /// A whole packet frame: header, the part before the shared payload, payload. `key` is its subscription.
    virtual void put(std::uint64_t key, const wire::frame_header& header, bytes_view head,
                     const shared_bytes& payload) = 0;
    /// That subscription has ended: what was put for it is neither sent nor sent again.
    virtual void forget(std::uint64_t key) noexcept = 0;

protected:
    ~packet_lane() = default;
};

} // namespace ise::net
