#pragma once
#include <ise/component/node_options.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/session/tracer.hpp>

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// What a node shows of itself to tools of others: metrics and spans (docs/metrics.md).
namespace ise {
struct node_state;
}

namespace ise::detail {

/// Serves metrics, or exports spans, on the node's loop.
class observing {
public:
    virtual ~observing() = default;
    /// Ends it, within a second. Cancellation: terminal.
    virtual task<> end() = 0;
    /// Where it is reached; empty for an export.
    virtual endpoint where() const { return {}; }
};

/// Completes `metrics`, `traces` and `trace_rate` from the environment, and makes `services.traces` where spans are
/// wanted. Throws errc::invalid_argument, with the variable.
void set_from_environment(node_options& options, environment& env);

/// "9464", "0.0.0.0:9464", "[::1]:9464", "tcp://host:9464"; nothing for "" and "none". Throws errc::invalid_argument.
std::optional<endpoint> metrics_address(std::string_view text);
/// From 0 to 1. errc::invalid_argument.
result<double> parse_trace_rate(std::string_view text);

/// Throws errc::address_in_use, and errc::io_failed where the library was built without HTTP.
std::unique_ptr<observing> serve_metrics(node_state& of, const endpoint& at);
/// Throws errc::io_failed (no such file), errc::invalid_argument (no such URL).
std::unique_ptr<observing> export_traces(node_state& of);

/// Where exported spans go.
class span_sink {
public:
    virtual ~span_sink() = default;
    /// One OTLP request as JSON, in one line. Cancellation: terminal, it may be lost.
    virtual task<result<void>> put(std::string request) = 0;
};
/// A collector at an http URL; without a path: `/v1/traces`. Throws errc::invalid_argument, and errc::io_failed where
/// the library was built without HTTP.
std::unique_ptr<span_sink> make_span_poster(loop& on, const std::string& url);

/// Spans as one OTLP request in JSON, in one line. `wall_ahead`: of the wall clock before the monotonic one.
std::string otlp_json(const std::vector<span>& spans, std::string_view service_instance, duration wall_ahead);

} // namespace ise::detail
