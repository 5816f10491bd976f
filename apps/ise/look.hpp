#pragma once
#include "commands.hpp"

/// The commands that look at a running system as a whole, or measure it.
namespace ise::cli {

struct doctor_options {
    duration interval = std::chrono::seconds(1); ///< between its two looks
};
/// What is wrong with the system, and what to do about it; problem(failed) if anything is.
task<> doctor(context& in, doctor_options options);

struct graph_options {
    std::string prefix; ///< these components, and whoever is connected to them
    bool dot = false;   ///< for Graphviz
};
/// Who is connected to whom, and over what.
task<> graph(context& in, graph_options options);

struct top_options {
    std::string prefix;
    duration every = std::chrono::seconds(1);
    std::optional<std::uint64_t> count; ///< tables until it ends
};
/// What every component does, again and again.
task<> top(context& in, top_options options);

struct ping_options {
    std::string name;
    std::uint64_t count = 5;
    duration every = std::chrono::milliseconds(200);
};
/// Round trips to a component.
task<> ping(context& in, ping_options options);

struct bench_options {
    std::string name, service, json; ///< without a service: ISE's own question how it is
    std::uint32_t concurrent = 1;    ///< calls at once
    duration length = std::chrono::seconds(5);
};
/// Calls a service for a while, as fast as it answers: how many a second, and how long they take.
task<> bench(context& in, bench_options options);

/// Bytes and packets of a subscription, by windows.
task<> bw(context& in, hz_options options);

struct delay_options {
    hz_options from;
    std::string field; ///< a time in the packets; empty: the one that is called so
};
/// How old packets are when they come, by windows.
task<> delay(context& in, delay_options options);

struct tree_options {
    std::string prefix;
    bool services = false; ///< under each component
};
/// The namespace as a tree.
task<> tree(context& in, tree_options options);

struct services_options {
    std::string prefix;
    bool all = false; ///< ISE's own too
};
/// The services of all components: who provides and who needs them.
task<> services(context& in, services_options options);
/// The packet types of all components.
task<> types(context& in, services_options options);

struct type_options {
    std::string act, name, service, other_name, other_service;
};
/// The packets of a service, or how those of two differ.
task<> type(context& in, type_options options);

} // namespace ise::cli
