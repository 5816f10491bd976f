#include <ise/deployment/checking.hpp>

#include <ise/component/nearest.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

namespace ise::deployment {
namespace {

using instantiation::argument;

std::string advice(const std::string& wanted, const std::vector<std::string>& known, std::string_view none) {
    auto near = nearest(wanted, known);
    if (!near.empty()) return fmt::format("did you mean '{}'?", near.front());
    return known.empty() ? std::string(none) : fmt::format("there are {}", fmt::join(known, ", "));
}

std::string as_argument(const parameter& of, const value& from) {
    // An address is no number to whoever wrote it as one.
    if (of.kind == parameter_kind::hexadecimal && from.is == value::kind::integer)
        return fmt::format("{:X}", static_cast<std::uint64_t>(from.integer));
    return from.plain();
}

std::string without_server(const std::string& name, const std::vector<std::string>& there) {
    auto result = advice(name, there, "there is none");
    return fmt::format("no instantiation server '{}' is registered; {} start it on that host: ise_instantiation_server "
                       "--name {} --programs FOLDER",
                       name, result.ends_with('?') ? result + " Else" : result + ";", name);
}

class checker {
public:
    explicit checker(std::vector<problem>& problems) : problems_(problems) {}

    void check(wanted_component& one, const type_info& type) {
        one.request.arguments.clear();
        for (const auto& given : one.parameters) check(one, type, given);
        for (const auto& variable : one.request.variables)
            if (std::ranges::find(type.variables, variable.name) == type.variables.end())
                wrong(one.name.at,
                      fmt::format("type '{}' does not let others set the environment variable '{}'; {}", type.name,
                                  variable.name, advice(variable.name, type.variables, "it reads none")));
    }

private:
    void check(wanted_component& one, const type_info& type, const wanted_parameter& given) {
        auto found = std::ranges::find(type.parameters, given.name.text, &parameter::name);
        if (found == type.parameters.end()) {
            std::vector<std::string> names;
            for (const auto& known : type.parameters) names.push_back(known.name);
            return wrong(given.name.at,
                         fmt::format("type '{}' has no parameter '{}'; {}", type.name, given.name.text.substr(0, 200),
                                     advice(given.name.text, names, "it has none")));
        }
        if (given.values.size() != 1 && !found->many)
            return wrong(given.name.at, fmt::format("parameter '{}' of type '{}' takes one value, not {}", found->name,
                                                    type.name, given.values.size()));
        for (const auto& one_value : given.values) {
            if (one_value.is == value::kind::unknown) continue; // was told when the file was read
            auto text = as_argument(*found, one_value);
            auto allowed = ise::check(*found, text);
            if (!allowed) wrong(one_value.at, allowed.error().message());
            else one.request.arguments.push_back({found->name, std::move(text)});
        }
    }
    void wrong(const place& at, std::string what) { problems_.push_back({at, std::move(what)}); }

    std::vector<problem>& problems_;
};

} // namespace

const type_info* host_state::type(const std::string& name) const {
    for (const auto& one : types)
        if (one.about.name == name) return &one.about;
    return nullptr;
}

const host_state* state_of(const deployment& of, const std::string& host, const std::vector<host_state>& all) {
    const auto* wanted = of.host(host);
    if (!wanted) return nullptr;
    auto found = std::ranges::find(all, wanted->server, &host_state::server);
    return found == all.end() ? nullptr : &*found;
}

void complete(deployment& of, const std::vector<host_state>& hosts, std::vector<problem>& problems) {
    std::set<std::string> used;
    for (const auto& one : of.components) used.insert(one.host.text);
    std::vector<std::string> servers;
    for (const auto& one : hosts) servers.push_back(one.server);
    for (const auto& host : of.hosts)
        if (used.contains(host.name.text) && !state_of(of, host.name.text, hosts))
            problems.push_back({host.name.at, without_server(host.server, servers)});
    checker check(problems);
    // Host and type: one mistake, however many components meet it.
    std::set<std::pair<std::string, std::string>> missing;
    for (auto& one : of.components) {
        const auto* state = state_of(of, one.host.text, hosts);
        if (!state) continue;
        if (one.type.text.empty()) continue; // was told when the file was read
        if (const auto* type = state->type(one.type.text)) {
            check.check(one, *type);
            continue;
        }
        if (!missing.insert({one.host.text, one.type.text}).second) continue;
        auto count = std::ranges::count_if(of.components, [&](const auto& other) {
            return other.host.text == one.host.text && other.type.text == one.type.text;
        });
        std::vector<std::string> names;
        for (const auto& known : state->types) names.push_back(known.about.name);
        problems.push_back({one.type.at, fmt::format("host '{}'{} has no component type '{}'{}; {}", one.host.text,
                                                     state->server == one.host.text
                                                         ? ""
                                                         : fmt::format(" (instantiation server '{}')", state->server),
                                                     one.type.text.substr(0, 200),
                                                     count == 1 ? "" : fmt::format(", which {} components need", count),
                                                     advice(one.type.text, names, "it has none"))});
    }
}

} // namespace ise::deployment
