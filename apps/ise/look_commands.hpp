#pragma once
#include "conversation.hpp"
#include "look.hpp"

namespace CLI {
class App;
}

namespace ise::cli {

/// What the commands that look and measure are told; outlives the parse.
struct look_places {
    doctor_options doctor;
    graph_options graph;
    top_options top;
    ping_options ping;
    bench_options bench;
    hz_options bw;
    delay_options delay;
    tree_options tree;
    services_options services;
    type_options type;
    std::string interval, every, ping_every, window, length, json;
    std::uint64_t lines = 0;
    bool once = false;
};

void add_look_commands(CLI::App& app, look_places& to, wish& made);

/// problem(usage) where the first word is no command, with the nearest that there is. Before the parse, whose own words
/// about it say less.
void refuse_unknown_command(const CLI::App& app, int count, const char* const* arguments);

} // namespace ise::cli
