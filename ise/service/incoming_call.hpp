#pragma once
#include <ise/core/time.hpp>
#include <ise/packet/adapt.hpp>
#include <ise/service/context.hpp>

#include <cstdint>
#include <memory>

namespace ise {

class session;

/// A request on its way to a handler.
struct incoming_call {
    std::shared_ptr<session> from;  ///< set where it is kept for longer than it takes to receive it
    std::uint64_t id = 0;
    time_point deadline;
    trace_id trace;
    const adapter* adapt = nullptr; ///< where the caller's request differs from ours
};

} // namespace ise
