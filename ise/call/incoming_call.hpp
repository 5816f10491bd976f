#pragma once
#include <ise/call/context.hpp>
#include <ise/core/error.hpp>
#include <ise/core/time.hpp>
#include <ise/core/verified_peer.hpp>
#include <ise/packet/adapt.hpp>
#include <ise/session/carried_packet.hpp>

#include <cstdint>
#include <memory>
#include <string>

namespace ise {

/// Where requests came from, and where their answers go: one session.
class call_origin {
public:
    virtual void reply(std::uint64_t id, outgoing_packet response) = 0;
    virtual void refuse(std::uint64_t id, const failure& why) = 0;
    /// The caller's path, or its address.
    virtual const std::string& caller() const noexcept = 0;
    /// The caller for people.
    virtual std::string caller_name() const = 0;
    /// What was verified of the caller.
    virtual const verified_peer& verified() const noexcept = 0;
    /// Lives on as long as this is held.
    virtual std::shared_ptr<call_origin> held() = 0;

protected:
    ~call_origin() = default;
};

/// A request on its way to a handler.
struct incoming_call {
    std::shared_ptr<call_origin> from; ///< set where it is kept for longer than it takes to receive it
    std::uint64_t id = 0;
    time_point deadline{};
    trace_id trace;
    const adapter* adapt = nullptr; ///< where the caller's request differs from ours
    std::uint64_t number = 0;       ///< outlives the session; 0: none
    bool again = false;             ///< may have been sent before, by that number
};

} // namespace ise
