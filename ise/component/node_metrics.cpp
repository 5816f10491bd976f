#include <ise/component/observing.hpp>

#include <ise/component/exposition.hpp>
#include <ise/component/health.hpp>
#include <ise/component/node_state.hpp>
#include <ise/core/limits.hpp>
#include <ise/core/real/process_figures.hpp>
#include <ise/core/waiter.hpp>
#include <ise/http/http_server.hpp>
#include <ise/service/service_host.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace ise::detail {
namespace {

constexpr duration time_to_answer = std::chrono::seconds(2); // for a component's loop
constexpr duration time_to_end = std::chrono::milliseconds(500);

using kind = exposition::kind;

struct histogram {
    std::vector<std::pair<double, std::uint64_t>> bounds;
    std::uint64_t count = 0;
    double sum = 0;
};

double in_seconds(duration length) { return std::chrono::duration<double>(length).count(); }

// One bucket a doubling, from 16 microseconds to 17 seconds, of those that are a quarter of one wide.
histogram of_doublings(const duration_histogram& from) {
    histogram made;
    std::uint64_t below = 0;
    for (std::size_t at = 0; at < duration_histogram::buckets; ++at) {
        made.count += from.count(at);
        below += from.count(at);
        const auto end = duration_histogram::end_of(at);
        const bool doubling = at >= 15 && at % 4 == 3 && end <= std::chrono::seconds(18);
        if (doubling) made.bounds.emplace_back(in_seconds(end), below);
    }
    made.sum = in_seconds(from.sum());
    return made;
}

using outcomes = std::map<std::string, std::uint64_t>;

outcomes outcomes_of(std::uint64_t answered, const outcome_counts& failures) {
    outcomes made;
    made["ok"] = answered;
    for (const auto& [why, count] : failures.all()) made[std::string(name_of(why))] += count;
    return made;
}

struct service_figures {
    service_load load;
    outcomes requests;
    histogram waited, handled;
};

/// What one component has counted.
struct component_figures {
    std::string path;
    bool answered = false; // its loop did, in time
    std::vector<service_figures> services;
    outcomes calls;
    std::uint64_t open_calls = 0, late_replies = 0, sessions = 0, unsent_bytes = 0;
    service_counts counts;
};

// On the component's loop.
component_figures figures_of(service_host& services) {
    component_figures made;
    auto health = health_of(services);
    made.answered = true;
    made.counts = services.counts();
    made.sessions = health.sessions.size();
    for (const auto& one : health.sessions) made.unsent_bytes += one.unsent_bytes;
    auto& calls = services.calls();
    made.calls = outcomes_of(calls.answered, calls.failures);
    made.open_calls = calls.open_calls();
    made.late_replies = calls.late_replies;
    for (auto& load : health.services) {
        service_figures one;
        if (auto served = services.services().find_calls(load.name)) {
            const auto& meter = served->meter();
            one.requests = outcomes_of(meter.answered_calls(), meter.failures());
            if (meter.handling()) one.handled = of_doublings(*meter.handling());
            if (meter.waiting()) one.waited = of_doublings(*meter.waiting());
        }
        one.load = std::move(load);
        made.services.push_back(std::move(one));
    }
    return made;
}

void add_process(exposition& to) {
    auto result = figures_of_this_process();
    if (!result) return;
    to.metric("process_cpu_seconds_total", kind::counter, "Processor time of the process, user and system.")
        .add({}, result->processor_seconds);
    to.metric("process_start_time_seconds", kind::gauge, "Start of the process, in seconds since 1970.")
        .add({}, result->began);
    to.metric("process_virtual_memory_bytes", kind::gauge, "Address space of the process.")
        .add({}, result->virtual_bytes);
    to.metric("process_resident_memory_bytes", kind::gauge, "Physical memory of the process.")
        .add({}, result->resident_bytes);
    to.metric("process_open_fds", kind::gauge, "Open file descriptors.").add({}, result->open_descriptors);
    to.metric("process_max_fds", kind::gauge, "Most file descriptors that may be open.")
        .add({}, result->max_descriptors);
    to.metric("process_threads", kind::gauge, "Threads of the process.").add({}, result->threads);
}

void add_component(exposition& to, const component_figures& of) {
    const std::string_view path = of.path;
    to.metric("ise_component_up", kind::gauge, "Whether the loop of the component answered within 2 s.")
        .add({{"component", path}}, std::uint64_t{of.answered});
    if (!of.answered) return;
    auto counter = [&](std::string_view name, std::string_view help, std::uint64_t value) {
        to.metric(name, kind::counter, help).add({{"component", path}}, value);
    };
    auto gauge = [&](std::string_view name, std::string_view help, std::uint64_t value) {
        to.metric(name, kind::gauge, help).add({{"component", path}}, value);
    };
    for (const auto& [outcome, count] : of.calls)
        to.metric("ise_calls_total", kind::counter, "Calls of the component to others that have ended, by outcome.")
            .add({{"component", path}, {"outcome", outcome}}, count);
    gauge("ise_calls_open", "Calls of the component to others that have not ended.", of.open_calls);
    counter("ise_late_replies_total", "Replies that came after their call had ended.", of.late_replies);
    counter("ise_requests_refused_total", "Requests that no handler began with, by any service.",
            of.counts.calls_refused);
    counter("ise_packets_received_total", "Packets of subscriptions of the component.", of.counts.packets_received);
    counter("ise_packets_lost_total", "Packets of subscriptions of the component that were lost.",
            of.counts.packets_lost);
    gauge("ise_sessions", "Sessions with other components.", of.sessions);
    gauge("ise_session_unsent_bytes", "Calls, replies and control frames that wait to be sent.", of.unsent_bytes);
}

void add_calls(exposition& to, std::string_view path, const service_figures& of) {
    const std::string_view service = of.load.name;
    for (const auto& [outcome, count] : of.requests)
        to.metric("ise_requests_total", kind::counter, "Requests of a service that have ended, by outcome.")
            .add({{"component", path}, {"service", service}, {"outcome", outcome}}, count);
    to.metric("ise_requests_running", kind::gauge, "Handlers of a service that run.")
        .add({{"component", path}, {"service", service}}, of.load.running);
    to.metric("ise_requests_waiting", kind::gauge, "Requests of a service that no handler is free for.")
        .add({{"component", path}, {"service", service}}, of.load.waiting);
    auto add = [&](std::string_view name, std::string_view help, const histogram& values) {
        if (values.count > 0)
            to.metric(name, kind::histogram, help)
                .add_histogram({{"component", path}, {"service", service}}, values.bounds, values.count, values.sum);
    };
    add("ise_request_wait_seconds", "Wait of requests for a free handler.", of.waited);
    add("ise_request_handling_seconds", "Time of handlers, of a sample of the requests.", of.handled);
}

void add_publication(exposition& to, std::string_view path, const service_load& of) {
    const std::string_view service = of.name;
    to.metric("ise_packets_published_total", kind::counter, "Packets that a service published.")
        .add({{"component", path}, {"service", service}}, of.published);
    to.metric("ise_packets_queued", kind::gauge, "Packets of a service that wait to be sent.")
        .add({{"component", path}, {"service", service}}, of.waiting);
    to.metric("ise_subscribers", kind::gauge, "Subscribers of a service.")
        .add({{"component", path}, {"service", service}}, of.subscribers);
    for (const auto& drop : of.drops)
        if (drop.reason != "ended")
            to.metric("ise_packets_dropped_total", kind::counter,
                      "Packets of a service that a subscriber did not get, by reason.")
                .add({{"component", path}, {"service", service}, {"reason", drop.reason}}, drop.count);
}

std::string text_of(const std::vector<component_figures>& all, exposition::format as, const tracer* spans) {
    exposition made(as);
    std::uint64_t left_out = 0;
    for (const auto& one : all) {
        add_component(made, one);
        for (const auto& service : one.services) {
            const bool never_used = service.load.name.starts_with("ise.") && service.load.calls == 0;
            if (never_used) continue;
            if (made.series() > limit::metric_series) ++left_out;
            else if (service.requests.empty()) add_publication(made, one.path, service.load);
            else add_calls(made, one.path, service);
        }
    }
    if (spans)
        made.metric("ise_spans_dropped_total", kind::counter, "Spans of calls that were not exported.")
            .add({}, spans->dropped());
    made.metric("ise_metrics_services_left_out", kind::gauge,
                "Services that these metrics leave out, as there are too many.")
        .add({}, left_out);
    add_process(made);
    return made.text();
}

class node_metrics final : public observing {
public:
    node_metrics(node_state& of, const endpoint& at)
        : node_(of), scope_(of.loop(), [this](const std::string& name, std::exception_ptr thrown) {
              node_.log.error(describe(thrown), {{"coroutine", name}});
          }) {
        http_limits limits;
        limits.message.max_body_bytes = 0;
        server_ = std::make_unique<http_server>(of.loop(), of.log, limits, [this](std::string name, task<> body) {
            scope_.spawn(std::move(name), std::move(body));
        });
        server_->get("/metrics", [this](http_request asked) { return answer(std::move(asked)); });
        server_->get("/", [](const http_request&) { return http_response{"Metrics are at /metrics.\n"}; });
        auto listening = server_->listen(at);
        if (!listening)
            throw error(listening.error().code(),
                        fmt::format("cannot serve metrics: {}; choose another address with --metrics, ISE_METRICS or "
                                    "node_options::metrics (\"none\": no metrics)",
                                    listening.error().message()));
        of.log.info("serves metrics", {{"url", server_->url() + "metrics"}});
    }

    task<> end() override {
        server_->stop();
        scope_.stop();
        co_await scope_.join_until(saturating_add(node_.loop().now(), time_to_end));
    }

    endpoint where() const override { return server_->where(); }

private:
    /// The components that are asked at one time.
    struct round {
        explicit round(loop& on) : answered(on), late(on, [this] { answered.resume(); }) {}

        std::vector<component_figures> all;
        std::size_t open = 0;
        waiter<> answered;
        timer late;
    };

    task<http_response> answer(http_request asked) {
        auto gathering = gather();
        auto all = co_await std::move(gathering);
        const bool open_metrics =
            asked.message.header("accept").find("application/openmetrics-text") != std::string::npos;
        const auto as = open_metrics ? exposition::format::open_metrics : exposition::format::prometheus;
        http_response made;
        made.content_type = exposition::content_type(as);
        made.body = text_of(all, as, node_.options.services.traces.get());
        co_return made;
    }

    task<std::vector<component_figures>> gather() {
        std::vector<std::shared_ptr<component_runner>> running;
        {
            std::lock_guard lock(node_.mutex);
            for (const auto& one : node_.runners)
                if (!one->over()) running.push_back(one);
        }
        auto asked = std::make_shared<round>(node_.loop());
        for (const auto& one : running) {
            const auto at = asked->all.size();
            asked->all.emplace_back();
            asked->all.back().path = one->path();
            auto ask = [asked = std::weak_ptr(asked), at, one, back = node_.loop().gate()] {
                if (one->over()) return;
                auto figures = std::make_shared<component_figures>(figures_of(one->services()));
                back->post([asked, at, figures] {
                    auto to = asked.lock();
                    if (!to) return;
                    figures->path = std::move(to->all[at].path);
                    to->all[at] = std::move(*figures);
                    if (--to->open == 0) to->answered.resume();
                });
            };
            if (one->on().gate()->post(std::move(ask))) ++asked->open;
        }
        if (asked->open > 0) {
            asked->late.arm(saturating_add(node_.loop().now(), time_to_answer));
            co_await asked->answered.wait();
        }
        co_return merged(std::move(asked->all));
    }

    // Those without a path are one: a label that differs for each life would never end.
    static std::vector<component_figures> merged(std::vector<component_figures> all) {
        bool first = true;
        std::erase_if(all, [&](component_figures& one) { return one.path.empty() && !std::exchange(first, false); });
        for (auto& one : all)
            if (one.path.empty()) one.path = "(anonymous)";
        return all;
    }

    node_state& node_;
    task_scope scope_;
    std::unique_ptr<http_server> server_;
};

} // namespace

std::unique_ptr<observing> serve_metrics(node_state& of, const endpoint& at) {
    return std::make_unique<node_metrics>(of, at);
}

} // namespace ise::detail
