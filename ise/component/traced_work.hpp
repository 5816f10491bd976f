#pragma once
#include <ise/component/component.hpp>
#include <ise/core/error.hpp>
#include <ise/core/time.hpp>
#include <ise/core/trace_id.hpp>
#include <ise/session/tracer.hpp>

#include <cstdint>
#include <string_view>

/// Spans of a component's own work, for what a call or a packet does not show: a message on its way over a radio, a
/// computation. See docs/metrics.md.
namespace ise {

/// Work that has ended.
struct traced_work {
    std::string_view name;
    std::string_view target; ///< for people; empty: none
    errc outcome{};          ///< zero: it went well
    time_point began{};
    duration took{};
    trace_id in;     ///< its trace, and the span that caused it: mostly the `current_trace()` of its beginning
    trace_id linked; ///< the trace that goes on with it, if it is another one, and the span in `parent`
};

/// Whether spans are exported here: without, nothing need be kept for them.
bool traces_work(const component& by) noexcept;

/// Exports a span of work in `work.in`; where that is no trace, or nothing is exported here, it does nothing. `id`: the
/// span's own; 0: a new one. On the component's thread.
void record_work(const component& by, const traced_work& work, std::uint64_t id = 0);

} // namespace ise
