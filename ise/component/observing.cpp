#include <ise/component/observing.hpp>

#include <ise/packet/detail/text_forms.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <iterator>
#include <utility>

namespace ise::detail {
namespace {

// Spans are written at the rate of calls: texts are appended, and what is the same for many is made once.

void append_number(std::string& to, std::int64_t number) {
    char digits[24];
    auto [end, problem] = std::to_chars(digits, digits + sizeof digits, number);
    to.append(digits, end);
}

void append_hex(std::string& to, std::uint64_t id) {
    char digits[16];
    for (auto at = std::rbegin(digits); at != std::rend(digits); ++at, id >>= 4) *at = "0123456789abcdef"[id & 15];
    to.append(digits, sizeof digits);
}

void append_attribute(std::string& to, std::string_view name, std::string_view text) {
    to.append(R"({"key":")").append(name).append(R"(","value":{"stringValue":)");
    append_json_string(to, text);
    to += "}}";
}

// As OTLP numbers the kinds of spans.
char kind_of(span::side side) noexcept {
    switch (side) {
        case span::side::client: return '3';
        case span::side::server: return '2';
        case span::side::producer: return '4';
        case span::side::consumer: return '5';
        case span::side::internal: break;
    }
    return '1';
}

// By OpenTelemetry's conventions for calls and for messages.
void append_attributes(std::string& to, const span& one) {
    if (one.of == span::side::internal) return append_attribute(to, "work.target", one.peer);
    const bool packet = one.of == span::side::producer || one.of == span::side::consumer;
    append_attribute(to, packet ? "messaging.system" : "rpc.system", "ise");
    to += ',';
    append_attribute(to, packet ? "messaging.destination.name" : "rpc.method", one.service);
    if (one.of == span::side::producer) return;
    to += ',';
    append_attribute(to, one.of == span::side::server ? "client.address" : "server.address", one.peer);
}

void append_span(std::string& to, const span& one, duration wall_ahead) {
    const auto began = (one.began.time_since_epoch() + wall_ahead).count();
    to += R"({"traceId":")";
    append_hex(to, one.in.high);
    append_hex(to, one.in.trace);
    to += R"(","spanId":")";
    append_hex(to, one.id);
    if (one.in.parent != 0) {
        to += R"(","parentSpanId":")";
        append_hex(to, one.in.parent);
    }
    to += R"(","name":)";
    append_json_string(to, one.service);
    to += R"(,"kind":)";
    to += kind_of(one.of);
    to += R"(,"startTimeUnixNano":")";
    append_number(to, began);
    to += R"(","endTimeUnixNano":")";
    append_number(to, began + std::max<std::int64_t>(one.took.count(), 0));
    to += R"(","attributes":[)";
    append_attributes(to, one);
    if (one.outcome != errc{}) {
        to += ',';
        append_attribute(to, "error.type", name_of(one.outcome));
    }
    to += ']';
    if (one.linked) {
        to += R"(,"links":[{"traceId":")";
        append_hex(to, one.linked.high);
        append_hex(to, one.linked.trace);
        to += R"(","spanId":")";
        append_hex(to, one.linked.parent);
        to += R"("}])";
    }
    if (one.outcome == errc{}) {
        to += R"(,"status":{"code":1}})";
        return;
    }
    to += R"(,"status":{"code":2,"message":)";
    append_json_string(to, name_of(one.outcome));
    to += "}}";
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
    if (auto report = env.variable("ISE_TRACE_RATE"); !options.trace_rate && report && !report->empty()) {
        auto rate = parse_trace_rate(*report);
        if (!rate) throw error(rate.error().code(), "ISE_TRACE_RATE: " + rate.error().message());
        options.trace_rate = *rate;
    }
    if (options.trace_rate && !(*options.trace_rate >= 0 && *options.trace_rate <= 1))
        throw error(errc::invalid_argument,
                    fmt::format("node_options::trace_rate is {}; it is from 0 to 1", *options.trace_rate));
    options.services.traces = std::make_shared<tracer>(options.trace_rate, env.random());
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
    constexpr std::size_t usual_span = 480; // bytes
    std::vector<std::vector<const span*>> by_component;
    for (const auto& one : spans) {
        auto same = [&](const auto& group) { return group.front()->component == one.component; };
        auto found = std::ranges::find_if(by_component, same);
        if (found == by_component.end()) found = by_component.emplace(found);
        found->push_back(&one);
    }
    std::string text;
    text.reserve(spans.size() * usual_span);
    text += R"({"resourceSpans":[)";
    for (const auto& group : by_component) {
        if (&group != &by_component.front()) text += ',';
        const auto& component = group.front()->component;
        text += R"({"resource":{"attributes":[)";
        append_attribute(text, "service.name", component.empty() ? "(anonymous)" : component);
        text += ',';
        append_attribute(text, "service.instance.id", service_instance);
        text += R"(]},"scopeSpans":[{"scope":{"name":"ise"},"spans":[)";
        for (const auto* one : group) {
            if (one != group.front()) text += ',';
            append_span(text, *one, wall_ahead);
        }
        text += "]}]}";
    }
    return text += "]}";
}

} // namespace ise::detail
