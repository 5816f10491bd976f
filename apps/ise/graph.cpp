// ise graph: the connections between components.
#include "graph_drawing.hpp"
#include "json.hpp"
#include "options.hpp"
#include "styled.hpp"
#include "survey.hpp"
#include "text.hpp"

#include <ise/core/time_text.hpp>
#include <ise/session/contract.hpp>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ise::cli {
namespace {

struct graph_options {
    std::string prefix;                          ///< these components, and whoever is connected to them
    bool dot = false;                            ///< for Graphviz
    duration interval = std::chrono::seconds(2); ///< a rate of 1 Hz is seen
};

struct graph_component {
    std::string path, state, host;
    bool answered = false;
    std::vector<std::string> missing; ///< services that it needs, and no component provides
};
struct graph_service {
    std::string service, provider, kind;
    std::optional<double> hz; ///< of the provider, for all its users
};
struct graph_connection {
    std::string a;
    std::optional<std::string> b; ///< null: a peer without a name, at `address`
    std::string address, over;
    std::uint64_t sessions = 0, bytes_to_a = 0, bytes_to_b = 0;
    std::optional<duration> round_trip_s;
    bool stalled = false;
    std::optional<double> to_a_bytes_per_s, to_b_bytes_per_s;
    std::vector<graph_service> services; ///< used over these sessions
};
struct connection_graph {
    std::string asked_at;
    std::vector<graph_component> components;
    std::vector<graph_connection> connections;
};

connection_graph as_answer(const drawn_graph& of, wall_time at) {
    connection_graph made;
    made.asked_at = iso_8601(at);
    for (const auto& one : of.components) {
        graph_component component{one.name.path,
                                  one.about ? one.about->state : one.name.state,
                                  one.name.host_name,
                                  one.about.has_value(),
                                  {}};
        for (const auto& need : of.missing)
            if (need.component == one.name.path) component.missing.push_back(need.service);
        made.components.push_back(std::move(component));
    }
    for (std::size_t which = 0; which < of.lines.size(); ++which) {
        const auto& one = of.lines[which];
        graph_connection line{.a = one.a,
                              .b = {},
                              .address = one.address,
                              .over = one.over,
                              .sessions = one.sessions,
                              .bytes_to_a = one.bytes_to_a,
                              .bytes_to_b = one.bytes_to_b,
                              .round_trip_s = {},
                              .stalled = one.stalled,
                              .to_a_bytes_per_s = {},
                              .to_b_bytes_per_s = {},
                              .services = {}};
        if (!one.b.empty()) line.b = one.b;
        if (one.round_trip > duration{}) line.round_trip_s = one.round_trip;
        if (const auto& rate = of.rates[which]) {
            line.to_a_bytes_per_s = rate->to_a;
            line.to_b_bytes_per_s = rate->to_b;
        }
        for (const auto& service : one.services) {
            const auto& provider = service.a_provides ? one.a : one.b;
            graph_service used{service.service, provider, {}, {}};
            if (auto kind = of.kinds.find({provider, service.service}); kind != of.kinds.end())
                used.kind = ise::name_of(static_cast<service_kind>(kind->second));
            if (auto hz = of.services.find({provider, service.service}); hz != of.services.end()) used.hz = hz->second;
            line.services.push_back(std::move(used));
        }
        made.connections.push_back(std::move(line));
    }
    return made;
}

task<> graph(context& in, graph_options options) {
    survey_options what; // of everything: what one needs another may provide
    auto before = co_await survey(in, what);
    co_await in.self.sleep(options.interval);
    in.until = saturating_add(in.self.now(), in.set.timeout);
    auto all = co_await survey(in, what);
    auto seen = graph_of(before, all, options.prefix);
    std::string text;
    if (in.set.json) {
        text = json_line(as_answer(seen, in.self.wall()));
    } else if (options.dot) {
        text = graph_as_dot(seen);
    } else {
        text = printed(graph_as_page(seen), in.out.width(), has_colours(in.self.env())) + show_age(in, all);
    }
    co_await in.out.write(in.self, std::move(text));
    if (seen.components.empty()) note_nothing(in, options.prefix);
    for (const auto& one : seen.components)
        if (!one.about) note(in.set, one.name.path + ": " + one.trouble);
}

void declare_graph(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<graph_options>();
    add_prefix(app, given->prefix);
    app.add_flag("--dot", given->dot, "for Graphviz: ise graph --dot | dot -Tsvg");
    add_time(app, "--interval", given->interval, "time between two looks, for the rates (default: 2s)");
    app.callback([&made, given] {
        check_prefix(given->prefix);
        made.looks = true;
        made.work = [given](context& in) { return graph(in, *given); };
    });
}

} // namespace

extern const command graph_command{"graph", see_group, "shows connections, what goes over them, and what is missing",
                                   "  ise graph\n  ise graph --dot | dot -Tsvg > graph.svg\n", declare_graph};

} // namespace ise::cli
