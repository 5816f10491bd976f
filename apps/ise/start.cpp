#include "commands.hpp"

#include "hosts.hpp"
#include "text.hpp"

#include <ise/component/component_type.hpp>
#include <ise/packet/json.hpp>

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

ordered_json type_json(const std::string& host, const instantiation::catalogue_type& type) {
    ordered_json told;
    told["host"] = host;
    told["type"] = type.about.name;
    told["description"] = type.about.description;
    told["path"] = type.about.path;
    told["program"] = type.program;
    told["parameters"] = ordered_json::array();
    for (const auto& one : type.about.parameters) told["parameters"].push_back(ordered_json::parse(ise::to_json(one)));
    told["services"] = ordered_json::array();
    for (const auto& one : type.about.services)
        told["services"].push_back({{"name", one.name}, {"kind", one.kind}, {"provided", one.provided}});
    told["variables"] = type.about.variables;
    return told;
}

std::string type_page(const std::string& host, const instantiation::catalogue_type& type, std::size_t width) {
    const auto& about = type.about;
    auto text = printable(fmt::format("{}  {} ({} on {})", about.name, about.description, type.program, host)) + "\n";
    std::string provided, required;
    for (const auto& one : about.services) (one.provided ? provided : required) += " " + printable(one.name);
    if (!about.path.empty()) text += fmt::format("  path      {}\n", printable(about.path));
    if (!provided.empty()) text += fmt::format("  provides {}\n", provided);
    if (!required.empty()) text += fmt::format("  requires {}\n", required);
    for (const auto& one : about.variables) text += fmt::format("  reads     {}\n", printable(one));
    std::size_t column = 10;
    for (const auto& one : about.parameters) column = std::max(column, std::min<std::size_t>(columns(one.name), 25));
    if (!about.parameters.empty()) text += "  parameters\n";
    for (const auto& one : about.parameters)
        text += printable(fmt::format("    {:<{}}  {}: {}{} (default: {})", one.name, column, one.description,
                                      allowed_values(one), one.changeable ? "; also while it runs" : "",
                                      one.preset.empty() ? "none" : one.preset)) +
                "\n";
    return (width == 0 ? text : wrapped(text, width)) + "\n";
}

std::pair<std::string, std::string> split_argument(const std::string& text, std::string_view option) {
    auto equals = text.find('=');
    if (equals == 0 || equals == std::string::npos)
        throw problem(exit_code::usage, "usage", fmt::format("{} takes NAME=VALUE, not '{}'", option, text));
    return {text.substr(0, equals), text.substr(equals + 1)};
}

task<> show_types(context& in, start_options options) {
    auto hosts = co_await hosts_there(in, options.host);
    std::string text;
    auto json = ordered_json::array();
    std::vector<std::string> known;
    bool found = false;
    for (auto& host : hosts) {
        instantiation::types_request question;
        auto told = co_await host.server.try_call(instantiation::services::types, question, in.left());
        if (!told) throw problem(told.error());
        for (const auto& type : told->types) {
            known.push_back(type.about.name);
            if (!options.type.empty() && type.about.name != options.type) continue;
            found = true;
            if (options.names) text += printable(type.about.name) + "\n";
            else if (in.set.json) json.push_back(type_json(host.name, type));
            else text += type_page(host.name, type, in.out.width());
        }
        for (const auto& trouble : told->problems)
            if (!options.names && options.type.empty()) note(in.set, fmt::format("{}: {}", host.name, trouble));
    }
    if (!options.type.empty() && !found) {
        auto near = nearest(options.type, known);
        throw problem(exit_code::not_reached, "no_such_name",
                      fmt::format("no host has a component type '{}'", options.type),
                      near.empty() ? "" : fmt::format("did you mean '{}'?", near.front()));
    }
    if (in.set.json && !options.names) text = json.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
    co_await in.out.write(in.self, std::move(text));
}

} // namespace

task<> start(context& in, start_options options) {
    if (options.types) {
        co_await show_types(in, options);
        co_return;
    }
    if (options.type.empty())
        throw problem(exit_code::usage, "usage", "which type is to be started?",
                      "ise start --types tells what there is");
    instantiation::start_request request;
    request.type = options.type;
    request.path = options.name;
    request.name_space = options.name_space;
    request.listen = options.listen;
    request.protocol = options.protocol;
    request.process = options.process;
    request.terms = options.terms;
    for (const auto& text : options.set) {
        auto [name, value] = split_argument(text, "--set");
        request.arguments.push_back({name, value});
    }
    for (const auto& text : options.variables) {
        auto [name, value] = split_argument(text, "--env");
        request.variables.push_back({name, value});
    }
    for (const auto& text : options.limits) {
        auto [name, value] = split_argument(text, "--limit");
        auto set = instantiation::set_limit(request.limits, name, value);
        if (!set) throw problem(exit_code::usage, "usage", set.error().message());
    }
    for (const auto& text : options.roles) {
        auto role = parse_role(text);
        if (!role) throw problem(role.error());
        request.roles.insert(std::move(*role));
    }
    auto host = co_await host_to_use(in, options.host);
    auto told = co_await host.server.try_call(instantiation::services::start, std::move(request), in.left());
    if (!told) throw problem(told.error());
    auto what = started(*told);
    auto text = in.set.json ? as_json(host.name, what) : as_sentence(host.name, what);
    co_await in.out.write(in.self, text + "\n");
}

} // namespace ise::cli
