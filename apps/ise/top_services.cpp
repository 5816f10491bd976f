#include "top_services.hpp"

#include "table.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;
using row = std::pair<const activity*, const service_activity*>;

// Nearly every call finds a handler at once: "0" reads better than the first bucket's end.
std::string show_wait(const std::optional<duration>& wait) {
    if (!wait) return "-";
    return *wait <= std::chrono::microseconds(2) ? "0" : show_duration(*wait);
}
std::string show_took(const std::optional<duration>& took) { return took ? show_duration(*took) : "-"; }

std::string show_losses(const service_activity& of) {
    std::string text;
    for (const auto& one : of.losses)
        text += fmt::format("{}{} {}{}", text.empty() ? "" : ", ", one.ever,
                            one.meanwhile > 0 ? fmt::format("+{} ", one.meanwhile) : "", one.reason);
    return text.empty() ? "-" : text;
}

std::vector<row> busiest(const std::vector<activity>& all, bool publish, std::size_t most) {
    std::vector<row> rows;
    for (const auto& one : all)
        for (const auto& service : one.services)
            if (service.publishes == publish && service.at_work()) rows.emplace_back(&one, &service);
    auto urgent = [](const row& of) { return std::tuple(of.second->loses(), of.second->waiting, of.second->hz); };
    std::ranges::stable_sort(rows, [&](const row& a, const row& b) { return urgent(a) > urgent(b); });
    rows.resize(std::min(rows.size(), most));
    return rows;
}

ordered_json seconds(const std::optional<duration>& length) {
    return length ? ordered_json(std::chrono::duration<double>(*length).count()) : ordered_json();
}

} // namespace

std::string services_table(const std::vector<activity>& all, std::size_t width, std::size_t most) {
    std::string text;
    if (auto rows = busiest(all, false, most); !rows.empty()) {
        table calls({"CALLS/S", "P50", "P99", "WAIT P50", "WAIT P99", "RUNNING", "WAITING", "REFUSED", "SERVICE"});
        for (const auto& [of, one] : rows)
            calls.add({fmt::format("{:.1f}", one->hz), show_took(one->handled_p50), show_took(one->handled_p99),
                       show_wait(one->waited_p50), show_wait(one->waited_p99), std::to_string(one->running),
                       std::to_string(one->waiting), show_losses(*one), fmt::format("{} {}", of->path, one->name)});
        text += fmt::format("\n{}", calls.text(width, {}, {"WAIT P50", "P50", "RUNNING", "WAITING", "WAIT P99"}));
    }
    if (auto rows = busiest(all, true, most); !rows.empty()) {
        table packets({"PACKETS/S", "SUBSCRIBERS", "WAITING", "NOT SENT", "PUBLICATION"});
        for (const auto& [of, one] : rows)
            packets.add({fmt::format("{:.1f}", one->hz), std::to_string(one->subscribers), std::to_string(one->waiting),
                         show_losses(*one), fmt::format("{} {}", of->path, one->name)});
        text += fmt::format("\n{}", packets.text(width, {}, {"WAITING", "SUBSCRIBERS"}));
    }
    return text;
}

ordered_json services_json(const activity& of) {
    auto all = ordered_json::array();
    for (const auto& one : of.services) {
        ordered_json told;
        told["name"] = one.name;
        told["kind"] = one.publishes ? "subscription" : "request-response";
        told["hz"] = one.hz;
        told["waiting"] = one.waiting;
        if (one.publishes) {
            told["subscribers"] = one.subscribers;
        } else {
            told["running"] = one.running;
            told["handled_p50_s"] = seconds(one.handled_p50);
            told["handled_p99_s"] = seconds(one.handled_p99);
            told["waited_p50_s"] = seconds(one.waited_p50);
            told["waited_p99_s"] = seconds(one.waited_p99);
        }
        auto losses = ordered_json::object();
        for (const auto& loss : one.losses) losses[loss.reason] = {{"ever", loss.ever}, {"now", loss.meanwhile}};
        told[one.publishes ? "not_sent" : "refused"] = std::move(losses);
        all.push_back(std::move(told));
    }
    return all;
}

} // namespace ise::cli
