// The instantiation server of a host as a program: starts components, and watches over them.
// Exit codes: 0 ended by SIGINT or SIGTERM, 1 it cannot run or failed (the reason is on stderr), 2 wrong usage.
#include <apps/program_options.hpp>
#include <ise/component/node.hpp>
#include <ise/core/complain.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/instantiation/instantiation_server.hpp>
#include <ise/instantiation/keeper.hpp>
#include <ise/instantiation/real_machine.hpp>
#include <ise/naming/name_servers.hpp>

#include <fmt/format.h>

#include <chrono>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <unistd.h>

namespace {

using namespace std::chrono_literals;

constexpr int cannot_run = 1;

struct settings {
    std::string programs;
    std::string state;
    std::string name;
    std::string name_server;
    std::vector<std::string> listen, advertise, addresses, hosts, paths, users;
    std::string identities;
    bool as_root = false;
    ise::security_options security;
    ise::node_options node; ///< metrics and traces
    ise::log_level log_level = ise::log_level::info;
    std::size_t instances = 64;
    ise::duration grace = std::chrono::seconds(5);
    bool leave_running = false;
};

std::string absolute(const std::string& path) {
    if (path.starts_with('/')) return path;
    char here[PATH_MAX] = {};
    if (!::getcwd(here, sizeof here)) throw std::runtime_error("the present folder has no name");
    return fmt::format("{}/{}", here, path);
}

std::string default_state_folder(const std::string& name) {
    if (const char* home = std::getenv("XDG_STATE_HOME")) return fmt::format("{}/ise/{}", home, name);
    if (const char* home = std::getenv("HOME")) return fmt::format("{}/.local/state/ise/{}", home, name);
    return "/var/lib/ise/" + name;
}

ise::endpoint endpoint_of(const std::string& option, const std::string& text) {
    auto at = ise::endpoint::parse(text);
    if (!at) throw command_line::parse_error(option, at.error().message());
    return *at;
}

// The variables that components get from this program's environment: what programs need to run, and the settings of
// traces and recorded calls, which then hold for all of them.
std::vector<std::pair<std::string, std::string>> variables_for_components(const ise::environment& env) {
    std::vector<std::pair<std::string, std::string>> kept;
    for (const char* name : {"PATH", "HOME", "USER", "LANG", "LC_ALL", "TZ", "TMPDIR", "XDG_RUNTIME_DIR",
                             "ISE_TRACE_RATE", "ISE_RECORD_CALLS"})
        if (const char* value = std::getenv(name)) kept.emplace_back(name, value);
    if (std::string traces = env.variable("ISE_TRACES").value_or(""); !traces.empty()) {
        const bool file = traces != "none" && traces.find("://") == traces.npos;
        kept.emplace_back("ISE_TRACES", file ? absolute(traces) : traces);
    }
    return kept;
}

// What is started has the same credentials, wherever it runs.
ise::security_options security_of(ise::security_options given, ise::environment& env) {
    auto whole = [&](std::string& path, const char* variable) {
        if (path.empty()) path = env.variable(variable).value_or("");
        if (!path.empty()) path = absolute(path);
    };
    whole(given.key_file, "ISE_KEY");
    whole(given.tls_folder, "ISE_TLS");
    whole(given.access_file, "ISE_ACCESS");
    whole(given.audit_file, "ISE_AUDIT");
    given.demanded = true; // whoever reaches it can start programs
    return given;
}

int run(const settings& wanted) {
    ise::real_environment env;
    auto name = wanted.name.empty() ? env.identity().host_name : wanted.name;
    auto path = ise::instantiation::path_of_host(name);

    ise::component_options where;
    for (const auto& text : wanted.listen) {
        where.listen.push_back(endpoint_of("--listen", text));
    }
    for (const auto& text : wanted.advertise) where.advertise.push_back(endpoint_of("--advertise", text));
    where.policy = ise::on_failure::stop_node;

    ise::instantiation::server_options options;
    options.programs_folder = absolute(wanted.programs);
    auto leaf = path.substr(path.rfind('/') + 1);
    options.state_folder = absolute(wanted.state.empty() ? default_state_folder(leaf) : wanted.state);
    if (wanted.name_server.empty()) {
        options.name_servers = ise::usual_name_servers(env).value();
    } else {
        auto parsed = ise::parse_name_servers(wanted.name_server);
        if (!parsed) throw command_line::parse_error("--name-server", parsed.error().message());
        options.name_servers = std::move(*parsed);
    }
    options.variables = variables_for_components(env);
    auto security = security_of(wanted.security, env);
    for (const auto& at : where.listen)
        ise::instantiation::may_listen(at, ise::security::load(env, security).value()).value();
    if (!security.key_file.empty()) options.variables.emplace_back("ISE_KEY", security.key_file);
    if (env.variable("ISE_KEY_LEGACY").value_or("") == "1") options.variables.emplace_back("ISE_KEY_LEGACY", "1");
    options.rules.has_certificates = !security.tls_folder.empty();
    if (options.rules.has_certificates) options.variables.emplace_back("ISE_TLS", security.tls_folder);
    if (!security.access_file.empty()) options.variables.emplace_back("ISE_ACCESS", security.access_file);
    if (!security.audit_file.empty()) options.variables.emplace_back("ISE_AUDIT", security.audit_file);
    options.max_instances = wanted.instances;
    options.rules.listen_addresses.insert(options.rules.listen_addresses.end(), wanted.addresses.begin(),
                                          wanted.addresses.end());
    options.rules.target_hosts = wanted.hosts;
    options.rules.path_folders = wanted.paths;
    if (!wanted.identities.empty()) options.rules.identities_folder = absolute(wanted.identities);
    options.rules.users = wanted.users;
    options.rules.as_root = wanted.as_root;

    ise::instantiation::real_machine host;
    auto folder = options.state_folder;
    auto programs = options.programs_folder;
    host.programs(programs).value();
    host.take_folder(folder).value();

    auto node_options = wanted.node;
    node_options.name = "instantiation_server";
    node_options.name_servers = options.name_servers;
    node_options.security = std::move(security);
    node_options.log = ise::log_to_stderr(wanted.log_level);
    ise::node node(env, std::move(node_options));
    const auto& server =
        node.start<ise::instantiation::instantiation_server>(path, std::move(where), host, std::move(options));
    int code = ise::run_until_signal(node, [&] {
        fmt::print("instantiation server {} serves the programs in {}\n", path, programs);
        std::fflush(stdout);
    });
    for (const auto& report : node.reports())
        if (!report.failure.empty()) ise::complain("ise_instantiation_server", report.failure);
    // What runs is ended with it, or found by the next one. After a failure (the name is another's) it is left alone.
    if (code != 0 || wanted.leave_running) return code;
    const auto state = folder + "/state.json";
    if (server.has_taken_over()) {
        host.end_all(wanted.grace);
        host.remove(state);
        host.remove(ise::instantiation::spare_of(state));
    } else if (host.size_of(state) != 0) {
        ise::complain("ise_instantiation_server",
                      fmt::format("stopped before it took over the components in {}, which run on: start and stop it "
                                  "again to end them",
                                  state));
    }
    return code;
}

} // namespace

int main(int argc, char** argv) {
    if (auto kept = ise::instantiation::keep_if_asked(argc, argv)) return *kept;
    command_line::app app("Starts components on this host on request (`ise start`), and supervises them.",
                          "ise_instantiation_server");
    settings wanted;
    app.add_option("--programs", wanted.programs,
                   "folder with the programs whose components can be started (those that answer --describe)")
        ->required()
        ->type_name("FOLDER");
    app.add_option("--state", wanted.state,
                   "folder for its state and its components' output (default: below $XDG_STATE_HOME or ~/.local/state)")
        ->type_name("FOLDER");
    app.add_option("--name", wanted.name, "of this host, under ise/host/ (default: the host's name)")
        ->type_name("NAME");
    app.add_option("--name-server", wanted.name_server,
                   "endpoints of the name servers, separated by commas (default: $ISE_NAME_SERVER, else " +
                       ise::default_name_server().text() + ")")
        ->type_name("ENDPOINT");
    app.add_option(
           "--listen", wanted.listen,
           "where to listen: beyond this host only with --key, or on tls:// or udp+tls:// with --tls (default: shared "
           "memory, a local socket and a port of the loopback interface)")
        ->type_name("ENDPOINT");
    app.add_option("--advertise", wanted.advertise,
                   "endpoint of a tunnel that leads to it, such as tcp://10.0.0.2:7501; several are allowed")
        ->type_name("ENDPOINT");
    app.add_option("--allow-address", wanted.addresses,
                   "a further address of this host that components and their parameters may listen on, such as "
                   "0.0.0.0; several are allowed (default: loopback)")
        ->type_name("ADDRESS");
    app.add_option("--allow-host", wanted.hosts,
                   "a host that URL parameters and health probes may name, such as gateway.example or 127.0.0.1:7411; "
                   "several are allowed (default: none)")
        ->type_name("HOST[:PORT]");
    app.add_option(
           "--allow-path", wanted.paths,
           "a folder or device that parameters may name, such as /dev/ttyUSB0; several are allowed (default: none)")
        ->type_name("PATH");
    app.add_option("--identities", wanted.identities,
                   "folder with one folder of certificates for each identity that components may have (default: none)")
        ->type_name("FOLDER");
    app.add_option("--allow-user", wanted.users,
                   "a user as whom components may be started, which only root can; several are allowed (default: none)")
        ->type_name("USER");
    app.add_flag("--as-root", wanted.as_root, "components may be started with the user root");
    app.add_option("--max-instances", wanted.instances, "maximum number of instances, including those that have ended")
        ->check(command_line::range(1, 4096))
        ->capture_default_str();
    add_duration(app, "--grace", wanted.grace, "0s", "1h",
                 "time for its components to end when it ends, such as 5s or 500ms")
        ->default_str("5s");
    app.add_flag("--leave-running", wanted.leave_running,
                 "its components continue when it ends, and the next server takes them over");
    add_credentials(app, wanted.security);
    add_audit(app, wanted.security);
    add_observing(app, wanted.node);
    add_log_level(app, wanted.log_level);
    app.set_version_flag("--version", "ise_instantiation_server " ISE_VERSION);
    app.footer(
        "Its components get its credentials and its access policy in ISE_KEY, ISE_TLS, ISE_ACCESS and ISE_AUDIT.\n"
        "If the server is killed, its components continue, and the next server with the same --state adopts them.\n"
        "Exit codes: 0 ended by a signal, 1 it cannot run or failed, 2 wrong usage.");
    try {
        app.parse(argc, argv);
        return run(wanted);
    } catch (const command_line::parse_error& wrong) {
        return app.exit(wrong);
    } catch (const std::exception& thrown) {
        ise::complain("ise_instantiation_server", thrown.what());
        return cannot_run;
    }
}
