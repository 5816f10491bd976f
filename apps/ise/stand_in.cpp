#include "stand_in.hpp"

#include "options.hpp"
#include "survey.hpp"
#include "text.hpp"

#include <ise/component/discover.hpp>
#include <ise/packet/json.hpp>
#include <ise/service/service_host.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

namespace ise::cli {
namespace {

// A line of `ise type show --json`.
struct told_packet {
    std::string role, name, fingerprint, schema;
};
struct told_service {
    std::string component, service, kind;
    std::vector<told_packet> packets;
};

constexpr std::size_t max_input_file = std::size_t{16} << 20;

dynamic_contract contract_of_line(const told_service& result, const std::string& file) {
    const bool calls = result.kind == ise::name_of(service_kind::request_response);
    if (!calls && result.kind != ise::name_of(service_kind::subscription))
        throw problem(exit_code::usage, "usage",
                      fmt::format("{}: '{}' is a service of an unknown kind, '{}'", file, result.service, result.kind));
    std::vector<std::string> texts;
    for (const auto& packet : result.packets) texts.push_back(packet.schema);
    auto made = dynamic_contract::parse(result.service,
                                        calls ? service_kind::request_response : service_kind::subscription, texts);
    if (!made) throw problem(exit_code::usage, "usage", fmt::format("{}: {}", file, made.error().message()));
    return std::move(*made);
}

dynamic_contract contract_in_file(context& in, const std::string& file, const std::string& service) {
    auto text = in.self.env().read_file(file, max_input_file);
    if (!text) throw problem(exit_code::usage, "usage", text.error().message());
    std::vector<std::string> names;
    std::size_t number = 0;
    for (std::size_t at = 0; at < text->size();) {
        auto end = std::min(text->find('\n', at), text->size());
        auto line = text->substr(at, end - at);
        at = end + 1;
        ++number;
        if (line.find_first_not_of(" \t\r") == line.npos) continue;
        told_service result;
        try {
            result = from_json<told_service>(line);
        } catch (const error& wrong) {
            throw problem(exit_code::usage, "usage", fmt::format("{}:{}: {}", file, number, wrong.what()),
                          "each line is what `ise type show NAME SERVICE --json` printed");
        }
        if (result.service == service) return contract_of_line(result, fmt::format("{}:{}", file, number));
        names.push_back(result.service);
    }
    throw problem(exit_code::usage, "usage", fmt::format("{} does not describe a service '{}'", file, service),
                  names.empty() ? "it describes none" : fmt::format("it describes {}", enumerate(names)));
}

std::optional<dynamic_contract> contract_at(const component_info& about, const std::string& service) {
    for (const auto& one : about.services) {
        if (one.name != service) continue;
        auto made = contract_of(one);
        if (made) return std::move(*made);
    }
    return std::nullopt;
}

} // namespace

void add_stand_in(command_line::app& app, stand_in_options& into) {
    app.add_option("PATH", into.path, "the path of the component whose place it takes")->required();
    app.add_option("--listen", into.listen, "where it listens (default: as every component)")->type_name("ENDPOINT");
    app.add_option("--types", into.types, "a file with lines of `ise type show NAME SERVICE --json`")
        ->type_name("FILE");
    app.add_option("--like", into.like, "a component that provides or needs the services, for their packets")
        ->type_name("NAME");
}

void takes_place(const stand_in_options& of, parsed_command& made) {
    check_name(of.path);
    if (!of.listen.empty()) {
        auto at = endpoint::parse(of.listen);
        if (!at) throw problem(exit_code::usage, "usage", fmt::format("--listen: {}", at.error().message()));
    }
    made.stands_in = of.path;
    made.listens_at = of.listen;
}

task<dynamic_contract> contract_for(context& in, stand_in_options from, std::string service) {
    if (!from.types.empty()) co_return contract_in_file(in, from.types, service);
    if (!from.like.empty()) {
        auto who = co_await reach(in, from.like);
        auto about = co_await ask_about(in, who);
        auto found = contract_at(about, service);
        if (!found)
            throw problem(exit_code::not_reached, "no_such_service",
                          fmt::format("{} neither provides nor needs a service '{}'", from.like, service));
        co_return std::move(*found);
    }
    survey_options all;
    auto there = co_await survey(in, all);
    std::map<std::vector<std::uint64_t>, std::pair<dynamic_contract, std::vector<std::string>>> found;
    for (const auto& one : there) {
        if (!one.about) continue;
        auto known = contract_at(*one.about, service);
        if (!known) continue;
        auto key = known->types()->fingerprints;
        auto [at, made] = found.try_emplace(std::move(key), *known, std::vector<std::string>());
        at->second.second.push_back(one.name.path);
    }
    if (found.empty())
        throw problem(exit_code::not_reached, "no_such_service",
                      fmt::format("no running component provides or needs a service '{}'", service),
                      "its packets are not known: describe it by --types FILE, made while its component runs: ise type "
                      "show NAME SERVICE --json > FILE");
    if (found.size() > 1) {
        std::vector<std::string> users;
        for (const auto& [key, one] : found) users.push_back(one.second.front());
        throw problem(exit_code::usage, "usage",
                      fmt::format("there are {} services '{}' with different packets", found.size(), service),
                      fmt::format("choose one with --like: {}", fmt::join(users, " or ")));
    }
    co_return found.begin()->second.first;
}

task<> check_place(context& in, stand_in_options of) {
    if (!of.listen.empty()) co_return;
    [[maybe_unused]] auto server = co_await reach_name_server(in);
    auto* names = in.self.services().resolver();
    if (!names) co_return;
    auto found = co_await names->resolve(of.path);
    if (!found) co_return;
    throw problem(exit_code::failed, "name_taken", fmt::format("'{}' is running already", of.path),
                  found->role ? "it is a role: take the place of a member, or of a name of its own"
                              : fmt::format("stop it first (ise stop {}), or take another name", of.path));
}

task<> take_place(context& in) {
    co_await in.self.ready();
    std::vector<std::string> where;
    for (const auto& at : in.self.services().listening()) where.push_back(at.text());
    note(in.set, fmt::format("listens at {}", fmt::join(reachable_first(where), ", ")));
}

} // namespace ise::cli
