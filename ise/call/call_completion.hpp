#pragma once
#include <ise/core/error.hpp>
#include <ise/core/loop.hpp>
#include <ise/session/carried_packet.hpp>

namespace ise {

/// How a call ended: a failure, or the response (valid during the call only).
struct call_outcome {
    const failure* why = nullptr;
    incoming_packet* response = nullptr;
};

/// Called once with the outcome, which it decodes; what it gives back completes the call, on its loop or wherever the
/// caller is.
using call_completion = unique_function<loop::ready_function(const call_outcome&)>;

} // namespace ise
