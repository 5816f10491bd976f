#include <ise/instantiation/catalogue.hpp>

#include <ise/component/nearest.hpp>
#include <ise/core/environment.hpp>
#include <ise/instantiation/words.hpp>
#include <ise/naming/services.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

namespace ise::instantiation {
namespace {

bool good_path(std::string_view path) { return path.size() <= naming::max_path && naming::is_path(path); }

failure wrong(std::string why) { return {errc::invalid_argument, std::move(why)}; }

// What may have been meant, before all that there is.
std::string meant(const std::string& wanted, const std::vector<std::string>& known) {
    auto near = nearest(wanted, known);
    return near.empty() ? "" : fmt::format("did you mean '{}'? ", near.front());
}

// Not what the loader, the shell or ISE itself looks at.
bool is_variable(std::string_view text) {
    auto good = [](unsigned char letter) {
        return (letter >= 'A' && letter <= 'Z') || (letter >= '0' && letter <= '9') || letter == '_';
    };
    bool letters = !text.empty() && text.size() <= 64 && !(text.front() >= '0' && text.front() <= '9') &&
                   std::ranges::all_of(text, good);
    return letters && !text.starts_with("LD_") && !text.starts_with("ISE_") && !text.starts_with("GCONV") &&
           text != "PATH" && text != "IFS" && text != "BASH_ENV" && text != "ENV";
}

// Options that every program has.
bool is_common(std::string_view name) {
    static constexpr std::string_view common[] = {
        "path",   "listen", "advertise",          "role", "name-server", "log-level", "key",    "tls",
        "access", "audit",  "demand-credentials", "poll", "help",        "describe",  "version"};
    return std::ranges::find(common, name) != std::end(common);
}

std::string objection_to(const type_info& type) {
    if (!is_word(type.name)) return fmt::format("a type cannot be called '{}'", shown(type.name));
    if (!type.path.empty() && !good_path(type.path))
        return fmt::format("type '{}': '{}' is not a path of a component", type.name, shown(type.path));
    std::set<std::string> names;
    for (const auto& one : type.parameters) {
        if (!is_word(one.name) || is_common(one.name) || !names.insert(one.name).second)
            return fmt::format("type '{}': a parameter cannot be called '{}'", type.name, shown(one.name));
        if (one.kind > parameter_kind::url)
            return fmt::format("type '{}': parameter '{}' is of a kind that is not known here", type.name, one.name);
        if (one.address.empty()) continue;
        auto address = std::ranges::find(type.parameters, one.address, &parameter::name);
        bool fits = one.kind == parameter_kind::integer && !one.many && address != type.parameters.end() &&
                    address->kind == parameter_kind::address && !address->many;
        if (!fits)
            return fmt::format("type '{}': the port '{}' has no address '{}': one is an integer, the other an address, "
                               "and each is given once",
                               type.name, one.name, shown(one.address));
    }
    for (const auto& name : type.variables)
        if (!is_variable(name))
            return fmt::format("type '{}': the variable '{}' cannot be set by others", type.name, shown(name));
    return {};
}

result<void> add_arguments(launch_plan& to, const type_info& type, const start_request& request,
                           const launch_rules& rules) {
    if (request.arguments.size() > rules.max_arguments)
        return wrong(
            fmt::format("{} arguments are given, {} are allowed", request.arguments.size(), rules.max_arguments));
    std::set<std::string> given;
    for (const auto& one : request.arguments) {
        auto found = std::ranges::find(type.parameters, one.name, &parameter::name);
        if (found == type.parameters.end()) {
            std::vector<std::string> names;
            for (const auto& known : type.parameters) names.push_back(known.name);
            return wrong(fmt::format("type '{}' has no parameter '{}'; {}it has {}", type.name, shown(one.name),
                                     meant(one.name, names),
                                     names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
        }
        auto allowed = check(*found, one.value);
        if (!allowed) return wrong(fmt::format("type '{}': {}", type.name, allowed.error().message()));
        auto may = rules.may_be(*found, one.value);
        if (!may) return wrong(fmt::format("type '{}': {}", type.name, may.error().message()));
        if (!given.insert(one.name).second && !found->many)
            return wrong(fmt::format("type '{}': parameter '{}' is given twice", type.name, one.name));
        to.words.push_back(fmt::format("--{}={}", one.name, one.value));
    }
    return {};
}

// What was given, else the preset.
std::vector<std::string> values_of(const parameter& of, const start_request& request) {
    std::vector<std::string> values;
    for (const auto& one : request.arguments)
        if (one.name == of.name) values.push_back(one.value);
    if (!values.empty()) return values;
    if (!of.many) return {of.preset};
    for (std::size_t from = 0; from < of.preset.size();) {
        auto to = std::min(of.preset.find(',', from), of.preset.size());
        values.push_back(of.preset.substr(from, to - from));
        from = to + 1;
    }
    return values;
}

// Where the component listens beside its own endpoints: they are tried before a start. A preset that is no endpoint
// tells people what happens without one.
void add_listening(launch_plan& to, const type_info& type, const start_request& request) {
    for (const auto& one : type.parameters) {
        if (one.kind == parameter_kind::endpoint) {
            for (const auto& value : values_of(one, request))
                if (auto at = endpoint::parse(value)) to.listen.push_back(std::move(*at));
        } else if (!one.address.empty()) {
            auto host = values_of(*std::ranges::find(type.parameters, one.address, &parameter::name), request).front();
            bool bare = host.find(':') != host.npos;
            auto at = endpoint::parse(fmt::format("tcp://{}{}{}:{}", bare ? "[" : "", host, bare ? "]" : "",
                                                  values_of(one, request).front()));
            if (at) to.listen.push_back(std::move(*at));
        }
    }
}

result<void> add_probe(launch_plan& to, const start_request& request, const launch_rules& rules) {
    if (request.terms.probe.empty()) return {};
    auto target = parse_probe(request.terms.probe);
    if (!target) return target.error();
    auto may = rules.may_probe(target->at, to.listen);
    if (!may) return wrong(fmt::format("'{}' cannot be probed: {}", shown(request.terms.probe), may.error().message()));
    to.probe = std::move(*target);
    return {};
}

result<void> add_variables(launch_plan& to, const type_info& type, const start_request& request) {
    if (request.variables.size() > type.variables.size())
        if (type.variables.empty())
            return wrong(fmt::format("type '{}' lets others set no environment variable", type.name));
    for (const auto& one : request.variables) {
        if (std::ranges::find(type.variables, one.name) == type.variables.end())
            return wrong(fmt::format("type '{}' does not let others set the environment variable '{}', only {}",
                                     type.name, shown(one.name), fmt::join(type.variables, ", ")));
        if (one.value.size() > max_parameter_value || one.value.find('\0') != std::string::npos)
            return wrong(
                fmt::format("the value of the environment variable '{}' is too long or holds a NUL", one.name));
        for (const auto& [name, value] : to.variables)
            if (name == one.name) return wrong(fmt::format("the environment variable '{}' is given twice", one.name));
        to.variables.emplace_back(one.name, one.value);
    }
    return {};
}

// Any free port or name; with certificates of an address that others know the host by, where one is allowed:
// certificates are seldom for loopback.
endpoint endpoint_for(protocol kind, const launch_rules& rules, std::uint64_t unique) {
    auto made = endpoint::any_of(kind, fmt::format("ise-{:016x}", unique));
    if (!kind->needs_certificates || !made.has_port()) return made;
    for (const auto& address : rules.listen_addresses) {
        auto other = made;
        other.host = address;
        if (!within_host(other)) return other;
    }
    return made;
}

result<void> add_endpoints(launch_plan& to, const start_request& request, const launch_rules& rules,
                           std::uint64_t unique) {
    constexpr std::size_t most = 8;
    auto wanted = request.listen;
    if (!request.protocol.empty() && !wanted.empty())
        return wrong("either a protocol or endpoints can be chosen, not both");
    if (!request.protocol.empty()) {
        const auto* kind = find_transport(request.protocol);
        if (!kind || kind->same_process)
            return wrong(fmt::format("the protocol is one of {}, not '{}'",
                                     fmt::join(schemes_between_processes(), ", "), shown(request.protocol)));
        wanted.push_back(endpoint_for(*kind, rules, unique).text());
    }
    if (wanted.size() > most) return wrong(fmt::format("{} endpoints are given, {} are allowed", wanted.size(), most));
    for (const auto& text : wanted) {
        auto at = rules.may_listen(text);
        if (!at) return at.error();
        to.words.push_back("--listen=" + at->text());
        to.listen.push_back(std::move(*at));
    }
    return {};
}

result<void> add_roles(launch_plan& to, const start_request& request) {
    constexpr std::size_t most = 16;
    if (request.roles.size() > most)
        return wrong(fmt::format("{} roles are given, {} are allowed", request.roles.size(), most));
    for (const auto& [role, priority] : request.roles) {
        if (!good_path(role))
            return wrong(
                fmt::format("'{}' is not a role: write it like a component's path, atirma/gateway", shown(role)));
        if (role == to.path)
            return wrong(fmt::format("'{}' is the component's own name: it is found without being a role", role));
        if (role == "ise" || role.starts_with("ise/")) return wrong(fmt::format("'{}' is kept for ISE itself", role));
        to.words.push_back(fmt::format("--role={}={}", role, priority));
    }
    return {};
}

result<void> check_process(const catalogue_type& type, const start_request& request) {
    if (request.process.empty()) return {};
    if (!is_word(request.process))
        return wrong(
            fmt::format("a shared process cannot be called '{}': lower-case letters, digits, - and _ make a name",
                        shown(request.process)));
    if (!type.shares_process)
        return wrong(fmt::format("components of {} cannot share a process: its main gives ise::main a list of types, "
                                 "not a function that makes them",
                                 type.program));
    if (!request.variables.empty())
        return wrong(
            "environment variables belong to a whole process: a component that shares one cannot be given its own");
    return {};
}

result<std::string> full_path(const type_info& type, const start_request& request) {
    auto path = request.path.empty() ? type.path : request.path;
    if (path.empty()) return wrong(fmt::format("type '{}' has no path of its own: give one", type.name));
    if (!request.name_space.empty()) path = request.name_space + "/" + path;
    if (!good_path(path))
        return wrong(fmt::format("'{}' is not a path of a component: write it like atirma/shore/xbee", shown(path)));
    if (path == "ise" || path.starts_with("ise/")) return wrong(fmt::format("'{}' is kept for ISE itself", path));
    return path;
}

} // namespace

void catalogue::add(const std::string& program, const std::string& description) {
    program_info message;
    try {
        message = from_json<program_info>(description);
    } catch (const error& unfit) {
        return add_problem(
            fmt::format("{}: its answer to --describe is not a description: {}", program, shown(unfit.what())));
    }
    for (auto& type : message.types) {
        auto why = objection_to(type);
        if (why.empty() && types_.size() >= max_types)
            why = fmt::format("type '{}' is one too many: {} are kept", type.name, max_types);
        if (auto other = types_.find(type.name); why.empty() && other != types_.end())
            why = fmt::format("type '{}' is the one of {}", type.name, other->second.program);
        if (!why.empty()) {
            add_problem(fmt::format("{}: {}", program, why));
            continue;
        }
        auto name = type.name;
        types_.emplace(std::move(name), catalogue_type{program, std::move(type), message.shares_process});
    }
}

const type_info* catalogue::find(const std::string& type) const {
    auto found = types_.find(type);
    return found == types_.end() ? nullptr : &found->second.about;
}

types_response catalogue::tell() const {
    types_response made;
    for (const auto& [name, type] : types_) made.types.push_back(type);
    made.problems = problems_;
    return made;
}

result<launch_plan> catalogue::plan(const start_request& request, const launch_rules& rules,
                                    std::uint64_t unique) const {
    auto found = types_.find(request.type);
    if (found == types_.end()) {
        std::vector<std::string> names;
        for (const auto& [name, type] : types_) names.push_back(name);
        return failure(errc::no_such_name,
                       fmt::format("there is no component type '{}' here; {}there {}", shown(request.type),
                                   meant(request.type, names),
                                   names.empty() ? "are none" : fmt::format("are {}", fmt::join(names, ", "))));
    }
    const auto& type = found->second.about;
    auto sharing = check_process(found->second, request);
    if (!sharing) return sharing.error();
    launch_plan made;
    made.program = found->second.program;
    auto path = full_path(type, request);
    if (!path) return path.error();
    made.path = std::move(*path);
    made.words = {"run", type.name, "--path=" + made.path};
    auto endpoints = add_endpoints(made, request, rules, unique);
    if (!endpoints) return endpoints.error();
    auto arguments = add_arguments(made, type, request, rules);
    if (!arguments) return arguments.error();
    add_listening(made, type, request);
    auto probe = add_probe(made, request, rules);
    if (!probe) return probe.error();
    auto roles = add_roles(made, request);
    if (!roles) return roles.error();
    auto variables = add_variables(made, type, request);
    if (!variables) return variables.error();
    return made;
}

} // namespace ise::instantiation
