#pragma once
#include <ise/core/asio_names.hpp>
#include <ise/core/time.hpp>
#include <ise/core/trace_id.hpp>
#include <ise/core/verified_peer.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace ise {

/// Information about the call that a handler answers. Nested calls inherit it: the executor of a handler's
/// coroutine carries it, so a call made there has the earlier of the two deadlines and the same trace.
struct call_context {
    std::string_view service;                ///< the called service
    std::string_view caller;                 ///< the caller's path, or its address if it has none
    std::string_view who;                    ///< the caller's verified identity (docs/access.md); empty: unknown
    const verified_peer* verified = nullptr; ///< all that was verified of the caller, while the handler runs
    time_point deadline = time_point::max(); ///< the deadline of the call, on the loop's clock
    trace_id trace;                          ///< the trace of the call
    std::uint64_t id = 0;                    ///< of the call, in the session with its caller
    /// For an exclusive service: the first caller whose request waits for this one. Otherwise empty.
    std::string_view waiting;
};

/// Text for a call that timed out inside `context`: that it may have waited for its own handler. Empty if it did not.
std::string suspected_cycle(const call_context& context);

class loop;

/// The contexts of the handlers on a loop. They stay as long as the loop: an executor that carries one may be kept for
/// longer than its handler and its service are there.
class call_contexts {
public:
    /// Those of `on`. A handler whose loop was abandoned keeps them for longer.
    static const std::shared_ptr<call_contexts>& of(loop& on);

    /// One that nobody uses.
    call_context& take();
    void give_back(call_context& unused) noexcept; ///< clears it for the next one

private:
    std::vector<std::unique_ptr<call_context>> all_;
    std::vector<call_context*> free_;
};

/// `on`, carrying `context`, which outlives every use of it.
asio::any_io_executor with_context(const asio::any_io_executor& on, const call_context* context);

/// The context that an executor carries, or null.
const call_context* context_of(const asio::any_io_executor& on) noexcept;

} // namespace ise
