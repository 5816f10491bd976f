#pragma once
#include <ise/call/context.hpp>
#include <ise/core/error.hpp>
#include <ise/core/held.hpp>
#include <ise/core/time.hpp>
#include <ise/core/verified_peer.hpp>
#include <ise/packet/adapt.hpp>
#include <ise/session/carried_packet.hpp>

#include <cstdint>
#include <string>

namespace ise {

/// Where requests came from, and where their answers go: one session.
class call_origin : public holdable {
public:
    virtual void reply(std::uint64_t id, outgoing_packet response) = 0;
    virtual void refuse(std::uint64_t id, const failure& why) = 0;
    /// The caller for people.
    virtual std::string caller_name() const = 0;
    /// The caller's path, or its address.
    const std::string& caller() const noexcept { return caller_; }
    /// What was verified of the caller.
    const verified_peer& verified() const noexcept { return verified_; }

protected:
    /// Both live as long as this.
    call_origin(const std::string& caller, const verified_peer& verified) noexcept
        : caller_(caller), verified_(verified) {}
    ~call_origin() = default;

private:
    const std::string& caller_;
    const verified_peer& verified_;
};

/// A request on its way to a handler.
struct incoming_call {
    std::uint64_t id = 0;
    time_point deadline{};
    trace_id trace;
    const adapter* adapt = nullptr; ///< where the caller's request differs from ours
    std::uint64_t number = 0;       ///< outlives the session; 0: none
    bool again = false;             ///< may have been sent before, by that number
};

} // namespace ise
