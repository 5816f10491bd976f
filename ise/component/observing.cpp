#include <ise/component/observing.hpp>

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <utility>

namespace ise::detail {
namespace {

std::string json_text(std::string_view text) {
    return nlohmann::json(text).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

std::string attribute(std::string_view name, std::string_view text) {
    return fmt::format(R"({{"key":"{}","value":{{"stringValue":{}}}}})", name, json_text(text));
}

std::string json_of(const span& one, duration wall_ahead) {
    const auto began = (one.began.time_since_epoch() + wall_ahead).count();
    const bool client = one.of == span::side::client;
    auto text = fmt::format(R"({{"traceId":"{:016x}{:016x}","spanId":"{:016x}")", one.in.high, one.in.trace, one.id);
    if (one.in.parent != 0) text += fmt::format(R"(,"parentSpanId":"{:016x}")", one.in.parent);
    text +=
        fmt::format(R"(,"name":{},"kind":{},"startTimeUnixNano":"{}","endTimeUnixNano":"{}","attributes":[)",
                    json_text(one.service), client ? 3 : 2, began, began + std::max<std::int64_t>(one.took.count(), 0));
    text += attribute("rpc.system", "ise") + "," + attribute("rpc.method", one.service) + "," +
            attribute(client ? "server.address" : "client.address", one.peer);
    if (one.outcome == errc{}) return text + R"(],"status":{"code":1}})";
    return text + fmt::format(R"(,{}],"status":{{"code":2,"message":"{}"}}}})",
                              attribute("error.type", name_of(one.outcome)), name_of(one.outcome));
}

} // namespace

void set_from_environment(node_options& options, environment& env) {
    auto fill = [&](std::string& option, const char* variable) {
        if (option.empty()) option = env.variable(variable).value_or("");
    };
    fill(options.metrics, "ISE_METRICS");
    fill(options.traces, "ISE_TRACES");
    (void)metrics_address(options.metrics); // before anything begins
    if (options.traces.empty() || options.traces == "none") return;
    if (!options.trace_rate) {
        auto report = env.variable("ISE_TRACE_RATE");
        auto rate = report && !report->empty() ? parse_trace_rate(*report) : result<double>(1.0);
        if (!rate) throw error(rate.error().code(), "ISE_TRACE_RATE: " + rate.error().message());
        options.trace_rate = *rate;
    }
    if (!(*options.trace_rate >= 0 && *options.trace_rate <= 1))
        throw error(errc::invalid_argument,
                    fmt::format("node_options::trace_rate is {}; it is from 0 to 1", *options.trace_rate));
    options.services.traces = std::make_shared<tracer>(*options.trace_rate, env.random());
}

std::optional<endpoint> metrics_address(std::string_view text) {
    if (text.empty() || text == "none") return std::nullopt;
    auto full = std::string(text);
    if (full.find_first_not_of("0123456789") == full.npos) full = "127.0.0.1:" + full;
    if (full.find("://") == full.npos) full = "tcp://" + full;
    auto at = endpoint::parse(full);
    if (!at || !full.starts_with("tcp://"))
        throw error(errc::invalid_argument,
                    fmt::format("'{}' is not an address for metrics: write a port, which is of the loopback interface "
                                "then, such as 9464, or an address with a port, such as 0.0.0.0:9464",
                                text.substr(0, 100)));
    return *at;
}

result<double> parse_trace_rate(std::string_view text) {
    double rate = -1;
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), rate);
    if (problem != std::errc() || end != text.data() + text.size() || !(rate >= 0 && rate <= 1))
        return failure(errc::invalid_argument,
                       fmt::format("'{}' is not a share of traces: a number from 0 to 1", text.substr(0, 40)));
    return rate;
}

std::string otlp_json(const std::vector<span>& spans, std::string_view service_instance, duration wall_ahead) {
    std::map<std::string_view, std::string> by_component;
    for (const auto& one : spans) {
        auto& text = by_component[one.component];
        text += (text.empty() ? "" : ",") + json_of(one, wall_ahead);
    }
    std::string resources;
    for (const auto& [path, text] : by_component)
        resources += fmt::format(
            R"({}{{"resource":{{"attributes":[{},{}]}},"scopeSpans":[{{"scope":{{"name":"ise"}},"spans":[{}]}}]}})",
            resources.empty() ? "" : ",", attribute("service.name", path.empty() ? "(anonymous)" : path),
            attribute("service.instance.id", service_instance), text);
    return fmt::format(R"({{"resourceSpans":[{}]}})", resources);
}

} // namespace ise::detail
