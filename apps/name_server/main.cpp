// The name server as a program: where the components of a system find each other.
// Exit codes: 0 ended by SIGINT or SIGTERM, 1 it cannot run (the reason is on stderr), 2 wrong usage.
#include <apps/program_options.hpp>
#include <ise/component/node.hpp>
#include <ise/core/complain.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/name_server/etcd_store.hpp>
#include <ise/name_server/name_server.hpp>
#include <ise/service/service_host.hpp>
#include <ise/transport/tls/identity.hpp>

#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <string_view>

namespace {

constexpr int cannot_run = 1;

void complain(std::string_view what) { ise::complain("ise_name_server", what); }

struct settings {
    std::vector<std::string> listen, advertise;
    std::string state;
    std::string store, store_user, store_password_file;
    ise::net::tls::identity_files store_tls;
    ise::duration lease = std::chrono::seconds(2);
    ise::security_options security;
    ise::node_options node; ///< metrics and traces
    ise::log_level log_level = ise::log_level::info;
    bool fresh = false;
};

// One for each place where a name server of this user listens; empty where nobody says where his files lie.
std::string default_state_file(const ise::endpoint& at) {
    std::string folder;
    if (const char* home = std::getenv("XDG_STATE_HOME"); home && *home) folder = home;
    else if (home = std::getenv("HOME"); home && *home) folder = fmt::format("{}/.local/state", home);
    if (folder.empty()) return {};
    auto name = at.text();
    for (char& letter : name)
        if (letter == '/' || letter == ':') letter = '+';
    return fmt::format("{}/ise/name_server/{}.json", folder, name);
}

// A file that was named is used or it is an error; the one that nobody named is used where there can be one.
std::shared_ptr<ise::server_memory> memory_of(const settings& wanted, ise::environment& env, const ise::endpoint& at) {
    bool any_port = at.port == 0 && at.path.empty(); // no other one comes to this place
    if (wanted.state == "none" || (wanted.state.empty() && any_port)) return nullptr;
    auto file = wanted.state.empty() ? default_state_file(at) : wanted.state;
    auto made = file.empty() ? nullptr : std::make_shared<ise::state_file>(env, file);
    auto usable = made
                      ? made->probe()
                      : ise::result<void>(ise::failure(ise::errc::io_failed, "neither XDG_STATE_HOME nor HOME is set"));
    if (usable) return made;
    if (!wanted.state.empty()) throw ise::error(usable.error());
    complain(fmt::format("keeps no state, so that names could be taken from their holders when it is started again: "
                         "{}; choose a file with --state",
                         usable.error().message()));
    return nullptr;
}

// The authorities for members over TLS, and the certificate of this side; null without TLS.
std::shared_ptr<ise::net::tls::identity> store_identity(const settings& wanted, ise::environment& env, bool over_tls) {
    const auto& files = wanted.store_tls;
    if (over_tls && files.authorities.empty())
        throw command_line::parse_error("--store",
                                        "etcds:// needs the authorities that sign its members: --store-ca-file");
    if (over_tls) return ise::net::tls::identity::load(env, files).value();
    if (!files.authorities.empty() || !files.certificate.empty())
        throw command_line::parse_error("--store", "must be etcds://… for --store-ca-file and --store-certificate");
    return nullptr;
}

// The password is in no option, since those of every process can be read by all.
std::optional<ise::etcd_options> store_of(const settings& wanted, ise::environment& env) {
    if (wanted.store.empty()) return std::nullopt;
    ise::etcd_options made;
    auto members = ise::parse_etcd_members(wanted.store);
    if (!members) throw command_line::parse_error("--store", members.error().message());
    made.members = std::move(*members);
    made.tls = store_identity(wanted, env, made.members.front().kind == ise::protocol::tls);
    made.user = wanted.store_user;
    if (!wanted.store_password_file.empty()) {
        made.password = env.read_secret(wanted.store_password_file, 4096).value();
        while (made.password.ends_with('\n')) made.password.pop_back();
    } else if (auto result = env.variable("ISE_STORE_PASSWORD")) {
        made.password = *result;
    }
    if (!made.user.empty() && made.password.empty())
        throw command_line::parse_error("--store-user",
                                        "needs a password: --store-password-file, or ISE_STORE_PASSWORD");
    return made;
}

int run(const settings& wanted) {
    ise::component_options where;
    where.registers = false;
    for (const auto& text : wanted.listen) {
        auto at = ise::endpoint::parse(text);
        if (!at) throw command_line::parse_error("--listen", at.error().message());
        where.listen.push_back(std::move(*at));
    }
    if (where.listen.empty()) where.listen.push_back(ise::default_name_server());
    for (const auto& text : wanted.advertise) {
        auto at = ise::endpoint::parse(text);
        if (!at) throw command_line::parse_error("--advertise", at.error().message());
        where.advertise.push_back(std::move(*at));
    }

    ise::real_environment env;
    auto options = wanted.node;
    options.name = "name_server";
    options.use_names = false; // it needs nobody to be found
    options.security = wanted.security;
    options.log = ise::log_to_stderr(wanted.log_level);
    ise::node node(env, std::move(options));

    ise::name_server_options terms;
    terms.lease = wanted.lease;
    terms.fresh = wanted.fresh;
    if (auto store = store_of(wanted, env))
        terms.store = [of = *store](ise::environment&, ise::loop& on) {
            return std::make_unique<ise::etcd_store>(on, of);
        };
    else terms.memory = memory_of(wanted, env, where.listen.front());
    std::string listening;
    try {
        auto& server = node.start<ise::name_server>(std::string(ise::naming::server_path), std::move(where), terms);
        for (const auto& at : server.services().listening())
            listening += (listening.empty() ? "" : " and ") + at.text();
    } catch (const ise::error& thrown) {
        if (thrown.code() != ise::errc::address_in_use) throw;
        complain(thrown.what());
        complain("perhaps a name server runs there already: one is enough. Otherwise choose another endpoint with "
                 "--listen, and set "
                 "ISE_NAME_SERVER to it for the others");
        return cannot_run;
    }
    return ise::run_until_signal(node, [&] {
        fmt::print("name server listens on {}\n", listening);
        std::fflush(stdout);
    });
}

} // namespace

int main(int argc, char** argv) {
    command_line::app app("Keeps the names of an ISE system: components register here and find each other by path.",
                          "ise_name_server");
    settings wanted;
    app.add_option("--listen", wanted.listen,
                   "endpoint to listen on, such as tcp://0.0.0.0:7400; several are allowed (default " +
                       ise::default_name_server().text() + ")");
    app.add_option("--advertise", wanted.advertise,
                   "endpoint of a tunnel that leads to it, such as tcp://10.0.0.2:7400; several are allowed")
        ->type_name("ENDPOINT");
    app.add_option("--state", wanted.state,
                   "state file that proves grants to the next name server, or none (default: below $XDG_STATE_HOME or "
                   "~/.local/state)")
        ->type_name("FILE");
    auto* store =
        app.add_option(
               "--store", wanted.store,
               "etcd that this name server shares its names with others in, as etcd (over TLS: etcds) followed by "
               ":// and its members: a:2379,b:2379,c:2379 (default: names are kept in memory)")
            ->type_name("STORE");
    app.add_option("--store-user", wanted.store_user, "user of the store (default: no authentication)")
        ->type_name("USER");
    app.add_option("--store-password-file", wanted.store_password_file,
                   "file with the user's password (default: $ISE_STORE_PASSWORD)")
        ->type_name("FILE");
    app.add_option("--store-ca-file", wanted.store_tls.authorities,
                   "PEM file of the authorities that sign the certificates of a store over TLS")
        ->needs(store)
        ->type_name("FILE");
    auto* certificate = app.add_option("--store-certificate", wanted.store_tls.certificate,
                                       "PEM file of a certificate of this side, for a store that demands one")
                            ->needs(store)
                            ->type_name("FILE");
    auto* key = app.add_option("--store-key-file", wanted.store_tls.key, "PEM file of its private key")
                    ->needs(certificate)
                    ->type_name("FILE");
    certificate->needs(key);
    add_duration(
        app, "--lease", wanted.lease, "50ms", "1h",
        "the longest lease, after which a lost node loses its names, such as 2s or 500ms; with --store up to 7s")
        ->default_str("2s");
    add_credentials(app, wanted.security);
    add_audit(app, wanted.security);
    add_observing(app, wanted.node);
    app.add_flag("--demand-credentials", wanted.security.demanded,
                 "refuse to listen beyond this host, except with a key or on tls://");
    add_log_level(app, wanted.log_level);
    app.add_flag("--fresh", wanted.fresh,
                 "no name server ran here before: grant names at once, without waiting one lease for former holders");
    app.set_version_flag("--version", "ise_name_server " ISE_VERSION);
    app.footer("Nodes find it at ISE_NAME_SERVER, or at " + ise::default_name_server().text() +
               ".\nExit codes: 0 ended by a signal, 1 it cannot run, 2 wrong usage.");
    try {
        app.parse(argc, argv);
        return run(wanted);
    } catch (const command_line::parse_error& wrong) {
        return app.exit(wrong);
    } catch (const std::exception& thrown) {
        complain(thrown.what());
        return cannot_run;
    }
}
