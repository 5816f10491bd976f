#include "commands.hpp"

#include "table.hpp"
#include "target.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

std::string as_json(const std::vector<naming::listed_name>& names) {
    auto all = ordered_json::array();
    for (const auto& one : names) {
        ordered_json told;
        told["path"] = one.path;
        told["state"] = one.state;
        told["type"] = one.type;
        told["host"] = one.host_name;
        told["process_id"] = one.process_id;
        told["node"] = one.node;
        told["epoch"] = std::to_string(one.epoch); // beyond 2^53 a JSON number is not exact
        told["incarnation"] = fmt::format("{:016x}", one.incarnation);
        told["lease_age_s"] = std::chrono::duration<double>(one.lease_age).count();
        told["endpoints"] = one.endpoints;
        told["services_provided"] = one.services_provided;
        all.push_back(std::move(told));
    }
    return all.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

std::string as_table(const std::vector<naming::listed_name>& names, std::size_t width) {
    table rows({"PATH", "STATE", "HOST", "PROCESS", "LEASE AGE", "SERVICES", "ENDPOINTS"});
    for (const auto& one : names)
        rows.add({one.path, one.state, one.host_name, std::to_string(one.process_id), show_duration(one.lease_age), std::to_string(one.services_provided),
                  fmt::format("{}", fmt::join(one.endpoints, " "))});
    return rows.text(width);
}

} // namespace

task<> list(context& in, list_options options) {
    auto names = co_await listed_names(in, options.prefix);
    std::string text;
    if (options.names) {
        for (const auto& one : names) text += printable(one.path) + "\n";
    } else if (in.set.json) {
        text = as_json(names);
    } else {
        text = as_table(names, in.out.width());
    }
    co_await in.out.write(in.self, std::move(text));
    if (names.empty() && !options.names)
        note(in.set, options.prefix.empty() ? std::string("no component is registered") : fmt::format("no component is registered under '{}'", options.prefix));
}

} // namespace ise::cli
