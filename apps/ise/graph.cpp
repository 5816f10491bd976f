// ise graph: the connections between components.
#include "connections.hpp"
#include "json.hpp"
#include "options.hpp"
#include "survey.hpp"
#include "text.hpp"

#include <memory>

namespace ise::cli {
namespace {

struct graph_options {
    std::string prefix; ///< these components, and whoever is connected to them
    bool dot = false;   ///< for Graphviz
};

struct graph_component {
    std::string path, state, host;
    bool answered = false;
};
struct graph_service {
    std::string service, provider;
};
struct graph_connection {
    std::string a;
    std::optional<std::string> b; ///< null: a peer without a name, at `address`
    std::string address, over;
    std::uint64_t sessions = 0, bytes_to_a = 0, bytes_to_b = 0;
    std::optional<duration> round_trip_s;
    bool stalled = false;
    std::vector<graph_service> services; ///< used over these sessions
};
struct connection_graph {
    std::string asked_at;
    std::vector<graph_component> components;
    std::vector<graph_connection> connections;
};

connection_graph graph_of(const std::vector<surveyed>& all, const std::vector<connection_line>& lines, wall_time at) {
    connection_graph made;
    made.asked_at = show_wall(at);
    for (const auto& one : all)
        made.components.push_back(
            {one.name.path, one.about ? one.about->state : one.name.state, one.name.host_name, one.about.has_value()});
    for (const auto& one : lines) {
        graph_connection line{one.a,          {}, one.address, one.over, one.sessions, one.bytes_to_a,
                              one.bytes_to_b, {}, one.stalled, {}};
        if (!one.b.empty()) line.b = one.b;
        if (one.round_trip > duration{}) line.round_trip_s = one.round_trip;
        for (const auto& service : one.services)
            line.services.push_back({service.service, service.a_provides ? one.a : one.b});
        made.connections.push_back(std::move(line));
    }
    return made;
}

task<> graph(context& in, graph_options options) {
    survey_options what;
    what.prefix = options.prefix;
    auto all = co_await survey(in, what);
    auto lines = connections_of(all);
    std::string text;
    if (in.set.json) {
        text = json_line(graph_of(all, lines, in.self.wall()));
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

void declare_graph(CLI::App& app, parsed_command& made) {
    auto given = std::make_shared<graph_options>();
    add_prefix(app, given->prefix);
    app.add_flag("--dot", given->dot, "for Graphviz: ise graph --dot | dot -Tsvg");
    app.callback([&made, given] {
        check_prefix(given->prefix);
        made.looks = true;
        made.work = [given](context& in) { return graph(in, *given); };
    });
}

} // namespace

extern const command graph_command{"graph", see_group, "shows the connections between components",
                                   "  ise graph\n  ise graph --dot | dot -Tsvg > graph.svg\n", declare_graph};

} // namespace ise::cli
