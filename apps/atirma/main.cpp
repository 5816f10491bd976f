// Hosts any of the components of A-Tirma in one process, or looks at a running system for a while.
#include "hosting.hpp"
#include "keys.hpp"
#include "observer.hpp"
#include "replaying.hpp"

#include <apps/program_options.hpp>
#include <components/boat/decoded_telemetry.hpp>
#include <components/communication_node/postgres_tools.hpp>
#include <components/communication_node/store_check.hpp>
#include <components/postgres/postgres.hpp>

#include <ise/core/complain.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/naming/name_servers.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace {

struct common_options {
    std::string name_server;
    ise::security_options security;
    ise::node_options node; ///< metrics and traces
    ise::log_level level = ise::log_level::info;
};

void add_common(command_line::app& to, common_options& options) {
    to.add_option("--name-server", options.name_server,
                  "endpoints of the name servers, separated by commas (default: ISE_NAME_SERVER, else this machine)");
    add_credentials(to, options.security);
    add_audit(to, options.security);
    add_observing(to, options.node);
    to.add_flag("--demand-credentials", options.security.demanded,
                "refuse to listen beyond this host, except with a key or on tls://");
    add_log_level(to, options.level);
}

ise::node_options node_options_of(const common_options& options) {
    auto made = options.node;
    made.name = "atirma";
    made.log = ise::log_to_stderr(options.level);
    made.security = options.security;
    if (!options.name_server.empty()) made.name_servers = ise::parse_name_servers(options.name_server).value();
    return made;
}

std::vector<ise::endpoint> endpoints_of(const std::vector<std::string>& texts) {
    std::vector<ise::endpoint> all;
    for (const auto& text : texts) all.push_back(ise::endpoint::parse(text).value());
    return all;
}

std::map<std::string, std::int32_t> roles_of(const std::vector<std::string>& texts) {
    std::map<std::string, std::int32_t> all;
    for (const auto& text : texts) all.insert(ise::parse_role(text).value());
    return all;
}

void say(const std::string& line) {
    static std::mutex one_at_a_time;
    std::lock_guard lock(one_at_a_time);
    std::fputs((line + "\n").c_str(), stdout);
    std::fflush(stdout);
}

void complain(std::string_view what) { ise::complain("atirma", what); }

int run(const common_options& common, const std::vector<atirma::hosted>& wanted) {
    ise::real_environment world;
    ise::node node(world, node_options_of(common));
    for (const auto& one : wanted) {
        ise::component_options options;
        options.listen = endpoints_of(one.listen);
        options.advertise = endpoints_of(one.advertise);
        options.roles = roles_of(one.roles);
        options.parameters = one.parameters;
        options.policy = ise::on_failure::stop_node;
        node.launch(one.path, one.make(), std::move(options));
    }
    int code = ise::run_until_signal(node, [&] {
        for (const auto& one : wanted) say("started: " + one.path);
    });
    for (const auto& report : node.reports()) {
        if (!report.failure.empty()) complain(report.path + ": " + report.failure);
        for (const auto& name : report.still_running) complain(report.path + ": did not end in time: " + name);
    }
    return code;
}

int observe(const common_options& common, const atirma::observer_options& options) {
    ise::real_environment world;
    ise::node node(world, node_options_of(common));
    auto seen = std::make_shared<atirma::observation>();
    ise::component_options anonymous;
    anonymous.listens = false;
    anonymous.registers = false;
    node.launch("", std::make_unique<atirma::observer>(options, seen), std::move(anonymous));
    int code = ise::run_until_signal(node);
    auto text = seen->text();
    text.pop_back();
    say(text);
    if (code != 0) return code;
    if (options.page && !seen->page_is_live()) complain("the page's event stream brought no telemetry");
    if (!seen->boat_answered()) complain("the boat acknowledged no telecommand");
    return (!options.page || seen->page_is_live()) && seen->boat_answered() ? 0 : 1;
}

int check_store(const std::string& file) {
    auto checked = atirma::is_postgres_url(file) ? atirma::check_database(file) : atirma::check_store(file);
    if (!checked) {
        complain(checked.error().message());
        return 1;
    }
    say(checked->text.substr(0, checked->text.size() - 1));
    return checked->sound ? 0 : 1;
}

int tell(const ise::result<std::string>& done) {
    if (done) say(*done);
    else complain(done.error().message());
    return done ? 0 : 1;
}

// Lines that say nothing of the boat are reported, and the next one is read.
int decode_input() {
    int code = 0;
    std::size_t number = 0;
    for (std::string line; std::getline(std::cin, line);) {
        ++number;
        auto decoded = atirma::decoded_telemetry(line);
        if (decoded) {
            say(*decoded);
        } else {
            complain(fmt::format("line {}: {}", number, decoded.error().message()));
            code = 1;
        }
    }
    return code;
}

// CLI11 takes the next word as the value of `--wind=`, which an instantiation server writes for an empty one.
std::vector<std::string> words_of(int count, char** words) {
    std::vector<std::string> all;
    for (std::string_view word : std::span(words, static_cast<std::size_t>(count)).subspan(1)) {
        bool empty = word.starts_with("--") && word.find('=') == word.size() - 1;
        if (empty) word.remove_suffix(1);
        all.emplace_back(word);
        if (empty) all.emplace_back();
    }
    return all;
}

int obey(int count, char** words) {
    command_line::app app{"The shore side of A-Tirma, and a simulated boat", "atirma"};
    app.set_version_flag("--version", "atirma " ATIRMA_VERSION);
    app.require_subcommand(1);
    bool describe = false; // read above, as `host`: they stand alone
    app.add_flag("--describe", describe,
                 "prints component types and their parameters as JSON, for instantiation servers");
    app.footer(
        "A parameter that is not given is taken from the environment: ISE_PARAMETER_WIND_SPEED for --wind-speed.\n"
        "Exit codes: 0 success, 1 failure, 2 wrong arguments.\n"
        "Example: atirma run boat-simulator --serial /tmp/xbee-boat xbee-link xbee-proxy --serial /tmp/xbee-shore "
        "web-server");

    common_options common;
    std::vector<atirma::hosted> wanted;
    auto* runs = app.add_subcommand("run", "run one component or several, until SIGINT or SIGTERM");
    add_common(*runs, common);
    runs->require_subcommand(1, 0);
    atirma::add_components(*runs, wanted, [] { return atirma::component_types(say); });

    atirma::replay_request replaying;
    auto* replays = app.add_subcommand("replay", "replay a recording into components on the virtual clock, and show "
                                                 "the first thing that they do otherwise");
    replays->add_option("recording", replaying.file, "a file of `ise record`")->required();
    replays
        ->add_option(
            "--ignore", replaying.ignored,
            "a field that is not compared: store, telemetry/store for one service, communication_state/* for all of "
            "a service; may be given several times")
        ->allow_extra_args(false);
    replays
        ->add_option("--only", replaying.only,
                     "this component or topic, or those below it, is played and compared; may be given several times")
        ->allow_extra_args(false);
    replays->add_option("--out", replaying.out, "a recording of what the components do now");
    add_log_level(*replays, replaying.level);
    replays->require_subcommand(1, 0);
    atirma::add_components(*replays, wanted, [] { return atirma::component_types(say); });
    replays->footer(
        "The components are those of `atirma run`, under the paths of the recording. Files of stores are real: give "
        "new ones, or memory:NAME.\n"
        "Exit codes: 0 no difference, 1 a difference or a failure, 2 wrong arguments.\n"
        "Example: atirma replay voyage.mcap --ignore store communication-node --path atirma/shore/node-1 --file "
        "memory:node");

    atirma::observer_options observer;
    double length_s = 30;
    std::string page;
    auto* observes = app.add_subcommand(
        "observe", "observe telemetry, telecommands and the page for some time, then print a summary");
    add_common(*observes, common);
    observes->add_option("--proxy", observer.proxy, "path of the proxy whose services are used")->capture_default_str();
    observes
        ->add_option("--telemetry", observer.telemetry,
                     "paths of the proxies whose telemetry is counted (default: that proxy)")
        ->allow_extra_args(false);
    observes->add_option("--page", page, "host:port of the web server whose event stream is read");
    observes->add_option("--for", length_s, "seconds")->check(command_line::range(1.0, 86400.0))->capture_default_str();

    std::string file;
    auto* store = app.add_subcommand("store", "the stores of communication nodes: files, and databases of PostgreSQL");
    store->require_subcommand(1);
    const std::string url_help = "postgresql:, user, host and database as a URL; the password comes from PGPASSFILE or "
                                 "PGPASSWORD";
    std::string url, stored_boat = "atirma";
    auto* checks =
        store->add_subcommand("check", "read everything in it and compare checksums; the node may be running");
    checks->add_option("store", file, "the node's --file or --store")->required();
    checks->footer("Exit codes: 0 the store is valid, 1 it is damaged or cannot be read, 2 wrong arguments.\n"
                   "Example: atirma store check /var/lib/atirma/node.db");
    auto* migrates = store->add_subcommand("migrate", "make or update the tables of a database; nodes may be running");
    migrates->add_option("store", url, url_help)->required();
    migrates->footer("Exit codes: 0 they are as this program needs them, 1 a failure, 2 wrong arguments.\n"
                     "Example: atirma store migrate postgresql://atirma@db.example/atirma");
    auto* imports = store->add_subcommand("import", "copy a file into a database; what is there already stays");
    imports->add_option("file", file, "a node's --file; its node is stopped, or goes on and it is imported again")
        ->required();
    imports->add_option("store", url, url_help)->required();
    imports->add_option("--boat", stored_boat, "name of the boat in the database")->capture_default_str();
    imports->footer("Exit codes: 0 done, 1 a failure, 2 wrong arguments.\n"
                    "Example: atirma store import /var/lib/atirma/node.db postgresql://atirma@db.example/atirma");
    auto* exports = store->add_subcommand("export", "copy a boat of a database into a file, which a node can use");
    exports->add_option("store", url, url_help)->required();
    exports->add_option("file", file, "the file; it is made if it is not there")->required();
    exports->add_option("--boat", stored_boat, "name of the boat in the database")->capture_default_str();
    exports->footer("Exit codes: 0 done, 1 a failure, 2 wrong arguments.\n"
                    "Example: atirma store export postgresql://atirma@db.example/atirma boat-2.db --boat boat-2");
    std::string kept_boat;
    std::optional<int> kept_kind;
    std::optional<std::uint32_t> kept_days;
    auto* retains = store->add_subcommand("retain", "how long a database keeps packets; prints all rules");
    retains->add_option("store", url, url_help)->required();
    retains->add_option("--boat", kept_boat, "of this boat (default: of all)");
    retains->add_option("--kind", kept_kind, "of this kind, its number on air (default: of all)")
        ->check(command_line::range(0, 255));
    auto* days =
        retains->add_option("--days", kept_days, "since measurement and reception (default: rules are only printed)")
            ->check(command_line::range(1, 100'000));
    bool kept_forever = false;
    retains->add_flag("--remove", kept_forever, "remove that rule")->excludes(days);
    retains->footer(
        "The most particular rule counts: boat and kind, then boat, then kind, then all. Nodes remove older "
        "packets once an hour.\n"
        "Exit codes: 0 done, 1 a failure, 2 wrong arguments.\n"
        "Example: atirma store retain postgresql://atirma@db.example/atirma --boat boat-2 --days 400");

    auto* keys = app.add_subcommand("keys", "the radio's key, which seals what boat and shore send");
    keys->require_subcommand(1);
    std::string boat = "atirma";
    auto* new_key = keys->add_subcommand(
        "new", "make a random key in a new file, readable by its owner only, and a recovery key beside it");
    new_key->add_option("file", file, "the key file; copy it to the boat and to the shore")->required();
    new_key->add_option("--boat", boat, "name of the boat: its key opens nothing of another boat")
        ->capture_default_str();
    new_key->footer("Exit codes: 0 made, 1 the file exists or cannot be written, 2 wrong arguments.\n"
                    "Example: atirma keys new radio.key");
    auto* show_key = keys->add_subcommand("show", "print boat, epoch and fingerprint of a key file, never the key");
    show_key->add_option("file", file, "the key file")->required();
    show_key->footer("Exit codes: 0 it is a key, 1 it is not or cannot be read, 2 wrong arguments.\n"
                     "Example: atirma keys show radio.key");

    std::string made, recovery;
    auto* rekey = keys->add_subcommand("rekey", "make the next key, in a new file with both; proxies with that file "
                                                "change the boat's key over the radio");
    rekey->add_option("file", file, "the key file in use")->required();
    rekey->add_option("new", made, "the new file: it replaces the key file on every shore host")->required();
    rekey->add_option("--recovery", recovery,
                      "file of the recovery key, which seals the change: needed if somebody else has changed the "
                      "boat's key, or has the one in use");
    rekey->footer("Copy the new file over the key file, first on the secondary node's host, and restart the proxies. "
                  "The boat accepts both keys until the first packet under the new one.\n"
                  "Exit codes: 0 made, 1 a file cannot be read or made, 2 wrong arguments.\n"
                  "Example: atirma keys rekey radio.key radio.next");
    auto* finish =
        keys->add_subcommand("finish", "remove the former key from a key file, once every link uses the next");
    finish->add_option("file", file, "the key file")->required();
    finish->footer("Exit codes: 0 done, 1 it has one key only or cannot be written, 2 wrong arguments.\n"
                   "Example: atirma keys finish radio.key");

    auto* decodes = app.add_subcommand(
        "decode", "reads lines of `ise echo NAME telemetry` and prints them with the fields of the boat's reports");
    decodes->footer(
        "Exit codes: 0 every line was decoded, 1 one was not (the reason is on standard error), 2 wrong arguments.\n"
        "Example: ise echo atirma/shore/xbee telemetry | atirma decode");

    try {
        app.parse(words_of(count, words));
    } catch (const command_line::parse_error& why) {
        if (count > 2 && std::string_view(words[1]) == "run" && words[2][0] != '-') {
            std::string known;
            bool there = false;
            for (const auto& type : runs->info().commands) {
                there = there || type.name == words[2];
                known += (known.empty() ? "" : ", ") + type.name;
            }
            if (!there) {
                complain(fmt::format("there is no component type '{}'; there are {}", words[2], known));
                return 2;
            }
        }
        return app.exit(why);
    }
    try {
        if (!common.name_server.empty()) ise::parse_name_servers(common.name_server).value();
        if (!page.empty()) observer.page = ise::endpoint::parse("tcp://" + page).value();
        for (const auto& one : wanted) {
            endpoints_of(one.listen);
            endpoints_of(one.advertise);
            roles_of(one.roles);
        }
    } catch (const ise::error& why) {
        complain(why.what());
        return 2;
    }
    observer.length = std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(length_s));
    try {
        if (checks->parsed()) return check_store(file);
        if (migrates->parsed()) return tell(atirma::migrate_database(url));
        if (imports->parsed()) return tell(atirma::import_store(file, url, stored_boat));
        if (exports->parsed()) return tell(atirma::export_store(url, stored_boat, file));
        if (retains->parsed())
            return tell(kept_days || kept_forever ? atirma::set_retention(url, kept_boat, kept_kind, kept_days)
                                                  : atirma::retention(url));
        if (replays->parsed()) return atirma::replay(replaying, wanted, say) ? 0 : 1;
        if (decodes->parsed()) return decode_input();
        if (new_key->parsed()) return atirma::new_radio_key(file, boat);
        if (show_key->parsed()) return atirma::show_radio_key(file);
        if (rekey->parsed()) return atirma::next_radio_key(file, made, recovery);
        if (finish->parsed()) return atirma::finish_radio_key(file);
        return observes->parsed() ? observe(common, observer) : run(common, wanted);
    } catch (const std::exception& why) {
        complain(why.what());
        return 1;
    }
}

} // namespace

int main(int count, char** words) {
    std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ); // as ise::main does
    std::string_view first = count > 1 ? words[1] : "";
    if (first == "--describe" || first == "host") // for instantiation servers
        return ise::main(
            count, words, [] { return atirma::component_types(say); }, ATIRMA_VERSION);
    return obey(count, words);
}
