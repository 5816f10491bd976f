#include "look.hpp"

#include "connections.hpp"
#include "survey.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

std::string as_json(const std::vector<surveyed>& all, const std::vector<connection_line>& lines, wall_time at) {
    ordered_json told;
    told["asked_at"] = show_wall(at);
    auto components = ordered_json::array();
    for (const auto& one : all) {
        ordered_json component;
        component["path"] = one.name.path;
        component["state"] = one.about ? one.about->state : one.name.state;
        component["host"] = one.name.host_name;
        component["answered"] = one.about.has_value();
        components.push_back(std::move(component));
    }
    told["components"] = std::move(components);
    auto connections = ordered_json::array();
    for (const auto& one : lines) {
        ordered_json connection;
        connection["a"] = one.a;
        connection["b"] = one.b.empty() ? ordered_json() : ordered_json(one.b);
        connection["address"] = one.address;
        connection["over"] = one.over;
        connection["sessions"] = one.sessions;
        connection["bytes_to_a"] = one.bytes_to_a;
        connection["bytes_to_b"] = one.bytes_to_b;
        connection["round_trip_s"] = one.round_trip > duration{}
                                         ? ordered_json(std::chrono::duration<double>(one.round_trip).count())
                                         : ordered_json();
        connection["stalled"] = one.stalled;
        auto used = ordered_json::array();
        for (const auto& service : one.services) {
            ordered_json use;
            use["service"] = service.service;
            use["provider"] = service.a_provides ? one.a : one.b;
            used.push_back(std::move(use));
        }
        connection["services"] = std::move(used);
        connections.push_back(std::move(connection));
    }
    told["connections"] = std::move(connections);
    return told.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

} // namespace

task<> graph(context& in, graph_options options) {
    survey_options what;
    what.prefix = options.prefix;
    auto all = co_await survey(in, what);
    auto lines = connections_of(all);
    std::string text;
    if (in.set.json) {
        text = as_json(all, lines, in.self.wall());
    } else if (options.dot) {
        text = connections_as_dot(all, lines);
    } else {
        text = connections_as_tree(all, lines) + show_age(in, all);
    }
    co_await in.out.write(in.self, std::move(text));
    if (all.empty()) note_nothing(in, options.prefix);
    for (const auto& one : all)
        if (!one.about) note(in.set, one.name.path + ": " + one.trouble);
}

} // namespace ise::cli
