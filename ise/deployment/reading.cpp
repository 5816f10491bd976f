#include <ise/deployment/reading.hpp>

#include <ise/component/nearest.hpp>
#include <ise/deployment/copies.hpp>
#include <ise/deployment/form.hpp>
#include <ise/naming/services.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <tuple>

namespace ise::deployment {
namespace {

using instantiation::restart_policy;
using instantiation::restart_terms;

class builder {
public:
    explicit builder(std::vector<problem>& problems) : problems_(problems) {}

    deployment build(const value& root) {
        const value* hosts = nullptr;
        const value* components = nullptr;
        const entry* defaults = nullptr;
        std::string name_space;
        bool in_own_space = true;
        form all("the deployment", problems_);
        all.key("name", [&](const entry& one) {
            made_.name = {one.what.text, one.what.at};
            if (one.what.is != value::kind::text) all.wrong_kind(one, "a text");
            else if (!naming::is_path(one.what.text))
                wrong(one.what.at,
                      fmt::format("'{}' is not a name: letters, digits, -, _ and . make one", shown(one.what.text)));
        });
        all.key("namespace", [&](const entry& one) {
            in_own_space = false;
            if (one.what.is == value::kind::text) name_space = one.what.text;
            else all.wrong_kind(one, "a text");
        });
        all.key("hosts", [&](const entry& one) { hosts = &one.what; });
        all.key("components", [&](const entry& one) { components = &one.what; });
        all.key("defaults", [&](const entry& one) { defaults = &one; });
        all.key("include", {}).key("variables", {}); // were read before
        all.read(root);
        if (!root.find("name")) wrong(root.at, "the deployment has no 'name'");
        if (in_own_space) name_space = made_.name.text;
        if (hosts) read_hosts(*hosts);
        if (made_.hosts.empty())
            wrong(root.at, "the deployment has no host: [hosts.boat] is where the instantiation server 'boat' runs");
        if (defaults) read_defaults(*defaults);
        if (components) read_components(*components, name_space);
        if (made_.components.empty())
            wrong(root.at, "the deployment has no component: [components.boat] describes one");
        return std::move(made_);
    }

private:
    static std::string shown(const std::string& text) { return text.substr(0, 200); }
    void wrong(const place& at, std::string what) { problems_.push_back({at, std::move(what)}); }

    void read_hosts(const value& from) {
        if (from.is != value::kind::table) return wrong(from.at, "'hosts' is a table of hosts: [hosts.boat]");
        for (const auto& one : from.entries) {
            wanted_host host;
            host.name = {one.key, one.at};
            host.server = one.key;
            form keys(fmt::format("host '{}'", shown(one.key)), problems_);
            keys.text("server", host.server).read(one.what);
            if (!naming::is_path(host.server) || host.server.find('/') != std::string::npos)
                wrong(one.at,
                      fmt::format("'{}' is not a name of an instantiation server: letters, digits, -, _ and . make one",
                                  shown(host.server)));
            made_.hosts.push_back(std::move(host));
        }
    }

    // Read on their own, so that a mistake is reported once and not for each component.
    void read_defaults(const entry& from) {
        form keys("'defaults'", problems_);
        if (from.what.is != value::kind::table) return keys.wrong_kind(from, "a table of keys of components");
        auto before = problems_.size();
        wanted_component ignored;
        add_shared_keys(keys, ignored, "the components");
        keys.read(from.what);
        if (problems_.size() == before) defaults_ = from.what;
    }

    // The keys that '[defaults]' may have, too.
    void add_shared_keys(form& keys, wanted_component& made, const std::string& of) {
        auto& request = made.request;
        keys.key("restart",
                 [this, &keys, &request, of](const entry& one) { read_restart(keys, one, request.terms, of); });
        keys.key("limits",
                 [this, &keys, &request, of](const entry& one) { read_limits(keys, one, request.limits, of); });
        keys.length("ready-within", request.terms.ready_within).length("grace", request.terms.grace);
        keys.text("protocol", request.protocol);
    }

    void read_components(const value& from, const std::string& name_space) {
        if (from.is != value::kind::table)
            return wrong(from.at, "'components' is a table of components: [components.boat]");
        if (from.entries.size() > max_components)
            return wrong(from.at, fmt::format("{} components are described, {} are allowed", from.entries.size(),
                                              max_components));
        for (auto one : from.entries) {
            one.what = laid_over(defaults_, std::move(one.what));
            made_.components.push_back(read_component(one, name_space));
        }
        for (const auto& one : made_.components) check_links(one);
    }

    wanted_component read_component(const entry& from, const std::string& name_space) {
        wanted_component made;
        made.name = {from.key, from.at};
        auto of = fmt::format("component '{}'", shown(from.key));
        auto& request = made.request;
        std::vector<value> listen, after;
        auto space = name_space;
        form keys(of, problems_);
        keys.key("type", [&](const entry& one) { take_word(keys, one, made.type); });
        keys.key("host", [&](const entry& one) { take_word(keys, one, made.host); });
        keys.key("parameters", [&](const entry& one) { read_parameters(keys, one, made); });
        keys.texts("listen", listen)
            .texts("after", after)
            .text("namespace", space)
            .text("process", request.process)
            .text("identity", request.identity)
            .text("user", request.user);
        add_shared_keys(keys, made, of);
        keys.key("probe", [&](const entry& one) { read_probe(keys, one, request.terms, of); });
        keys.key("roles", [&](const entry& one) { read_roles(keys, one, request); });
        keys.key("environment", [&](const entry& one) { read_environment(keys, one, request); });
        keys.read(from.what);

        for (const auto& one : listen) {
            auto at = endpoint::parse(one.text);
            if (at) request.listen.push_back(one.text);
            else wrong(one.at, fmt::format("'listen' of {}: {}", of, at.error().message()));
        }
        if (from.what.find("after")) {
            made.after.emplace();
            for (const auto& one : after) made.after->push_back({one.text, one.at});
        }
        if (made.type.text.empty() && !from.what.find("type"))
            wrong(from.at, fmt::format("{} has no 'type': ise start --types lists the types", of));
        take_host(made, of, from.what.find("host") != nullptr);
        const auto* kind = find_transport(request.protocol);
        if (!request.protocol.empty() && (!kind || kind->same_process))
            wrong(from.what.find("protocol")->what.at,
                  fmt::format("'protocol' of {} is one of {}, not '{}'", of,
                              fmt::join(schemes_between_processes(), ", "), shown(request.protocol)));
        else if (!request.protocol.empty() && !listen.empty())
            wrong(from.at, fmt::format("{} has both 'protocol' and 'listen': choose one", of));
        request.type = made.type.text;
        request.path = space.empty() ? from.key : space + "/" + from.key;
        request.deployment = made_.name.text;
        if (!naming::is_path(request.path) || request.path.size() > naming::max_path)
            wrong(from.at, fmt::format("'{}' is not a path of a component: write it like atirma/shore/xbee",
                                       shown(request.path)));
        else if (request.path == "ise" || request.path.starts_with("ise/"))
            wrong(from.at, fmt::format("'{}' is kept for ISE itself", request.path));
        return made;
    }

    void take_word(const form& keys, const entry& one, word& into) {
        into = {one.what.text, one.what.at};
        if (one.what.is != value::kind::text) keys.wrong_kind(one, "a text");
        else if (one.what.text.empty()) wrong(one.what.at, fmt::format("'{}' is empty", one.key));
    }

    void take_host(wanted_component& of, const std::string& name, bool said) {
        if (!said && made_.hosts.size() == 1) of.host = made_.hosts.front().name;
        else if (!said && !made_.hosts.empty())
            wrong(of.name.at, fmt::format("{} has no 'host', and there are several", name));
        else if (said && !of.host.text.empty() && !made_.host(of.host.text)) {
            std::vector<std::string> names;
            for (const auto& one : made_.hosts) names.push_back(one.name.text);
            wrong(of.host.at,
                  fmt::format("there is no host '{}'; {}", shown(of.host.text), advice(of.host.text, names)));
        }
    }

    static std::string advice(const std::string& wanted, const std::vector<std::string>& names) {
        auto near = nearest(wanted, names);
        if (!near.empty()) return fmt::format("did you mean '{}'?", near.front());
        return names.empty() ? std::string("there are none") : fmt::format("there are {}", fmt::join(names, ", "));
    }

    void read_parameters(const form& keys, const entry& from, wanted_component& into) {
        if (from.what.is != value::kind::table) return keys.wrong_kind(from, "a table");
        for (const auto& one : from.what.entries) {
            auto values = one.what.is == value::kind::array ? one.what.items : std::vector<value>{one.what};
            for (const auto& item : values)
                if (item.is == value::kind::table || item.is == value::kind::array) {
                    wrong(item.at,
                          fmt::format("parameter '{}' is a text, a number, true or false, or an array of them, not {}",
                                      shown(one.key), item.kind_name()));
                    break;
                }
            into.parameters.push_back({{one.key, one.at}, std::move(values)});
        }
    }

    void read_restart(const form& keys, const entry& from, restart_terms& into, const std::string& of) {
        auto policy = [&](const value& said) {
            if (said.text == "never") into.policy = restart_policy::never;
            else if (said.text == "on-failure") into.policy = restart_policy::on_failure;
            else if (said.text == "always") into.policy = restart_policy::always;
            else
                wrong(said.at, fmt::format("the restart policy of {} is never, on-failure or always, not '{}'", of,
                                           said.is == value::kind::text ? shown(said.text) : said.plain()));
        };
        if (from.what.is == value::kind::text) return policy(from.what);
        if (from.what.is != value::kind::table)
            return keys.wrong_kind(from, "a policy (never, on-failure, always) or a table");
        form terms(fmt::format("'restart' of {}", of), problems_);
        terms.key("policy", [&](const entry& one) { policy(one.what); });
        terms.count("limit", into.limit, 1000).length("window", into.window);
        terms.length("first-pause", into.first_pause).length("max-pause", into.max_pause);
        terms.read(from.what);
        if (!from.what.find("policy")) wrong(from.at, fmt::format("'restart' of {} has no 'policy'", of));
    }

    void read_limits(const form& keys, const entry& from, instantiation::resource_limits& into, const std::string& of) {
        if (from.what.is != value::kind::table)
            return keys.wrong_kind(from, "a table of limits: { pids = 64, memory = \"256 MiB\" }");
        form limits(fmt::format("'limits' of {}", of), problems_);
        for (const char* name : {"pids", "memory", "cpus"})
            limits.key(name, [this, &into, name](const entry& one) {
                auto set = instantiation::set_limit(into, name, one.what.plain());
                if (!set) wrong(one.what.at, set.error().message());
            });
        limits.read(from.what);
    }

    void read_probe(const form& keys, const entry& from, restart_terms& into, const std::string& of) {
        if (from.what.is == value::kind::text) {
            into.probe = from.what.text;
            return;
        }
        if (from.what.is != value::kind::table)
            return keys.wrong_kind(from, "a URL such as \"http://127.0.0.1:8080/\" or a table");
        form probe(fmt::format("'probe' of {}", of), problems_);
        probe.text("url", into.probe).length("every", into.probe_every).count("failures", into.probe_failures, 1000);
        probe.read(from.what);
        if (into.probe.empty()) wrong(from.at, fmt::format("'probe' of {} has no 'url'", of));
    }

    void read_roles(const form& keys, const entry& from, instantiation::start_request& into) {
        if (from.what.is != value::kind::table) return keys.wrong_kind(from, "a table of roles with their priorities");
        for (const auto& one : from.what.entries) {
            constexpr std::int64_t most = 1'000'000'000;
            if (one.what.is == value::kind::unknown) continue;
            bool fits = one.what.is == value::kind::integer && one.what.integer >= -most && one.what.integer <= most;
            if (!naming::is_path(one.key))
                wrong(one.at, fmt::format("'{}' is not a role: write it like a component's path, \"atirma/gateway\"",
                                          shown(one.key)));
            else if (!fits)
                wrong(one.what.at,
                      fmt::format("the priority in the role '{}' is an integer, the highest is preferred", one.key));
            else into.roles[one.key] = static_cast<std::int32_t>(one.what.integer);
        }
    }

    void read_environment(const form& keys, const entry& from, instantiation::start_request& into) {
        if (from.what.is != value::kind::table) return keys.wrong_kind(from, "a table of variables");
        for (const auto& one : from.what.entries) {
            if (one.what.is == value::kind::table || one.what.is == value::kind::array)
                wrong(one.what.at, fmt::format("the environment variable '{}' is a text", shown(one.key)));
            else into.variables.push_back({one.key, one.what.plain()});
        }
    }

    void check_links(const wanted_component& of) {
        if (!of.after) return;
        std::vector<std::string> names;
        for (const auto& one : made_.components)
            if (one.name.text != of.name.text) names.push_back(one.name.text);
        for (const auto& one : *of.after) {
            if (one.text == of.name.text)
                wrong(one.at, fmt::format("component '{}' cannot come after itself", one.text));
            else if (!made_.component(one.text))
                wrong(one.at, fmt::format("there is no component '{}'; {}", shown(one.text), advice(one.text, names)));
        }
    }

    deployment made_;
    value defaults_; ///< keys of a component
    std::vector<problem>& problems_;
};

} // namespace

const wanted_host* deployment::host(const std::string& wanted) const {
    for (const auto& one : hosts)
        if (one.name.text == wanted) return &one;
    return nullptr;
}

std::optional<std::size_t> deployment::component(const std::string& wanted) const {
    for (std::size_t at = 0; at < components.size(); ++at)
        if (components[at].name.text == wanted) return at;
    return std::nullopt;
}

reading read_deployment(const std::string& file, const file_reader& read, const settings& given) {
    reading result;
    auto root = load(file, read, result.problems);
    if (result.problems.empty()) { // what stands on what cannot be read says nothing new
        put_variables_in(root, given, result.problems);
        make_copies(root, result.problems);
        result.made = builder(result.problems).build(root);
    }
    std::ranges::stable_sort(result.problems, {},
                             [](const problem& one) { return std::tuple(one.at.file, one.at.line, one.at.column); });
    return result;
}

} // namespace ise::deployment
