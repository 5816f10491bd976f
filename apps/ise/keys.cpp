// ise keys: certificates of a system, without openssl's own command. Talks to no component.
#include "deployments.hpp"
#include "json.hpp"
#include "keys_files.hpp"
#include "options.hpp"
#include "pki.hpp"
#include "text.hpp"

#include <ise/core/real/environment.hpp>
#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace ise::cli {
namespace {

using pki::days;
using pki::moment;

constexpr days authority_days{3650};
constexpr days shore_days{30};
constexpr days boat_days{400};
// As long as a boat's certificate: a host that is away gets no new list, and without one it refuses every peer.
constexpr days list_days{400};
constexpr int most_days = 36500;

moment now() { return std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now()); }

struct keys_options {
    std::string system, identity, folder, authority = "authority";
    std::vector<std::string> hosts, what, into, operators, boats;
    std::string file; ///< of a deployment
    std::optional<std::uint64_t> days;
    std::optional<duration> every;
    bool boat = false, at_once = false;
};

days days_of(const keys_options& given, days otherwise) {
    if (!given.days) return otherwise;
    if (*given.days == 0 || *given.days > most_days)
        throw problem(exit_code::usage, "usage", fmt::format("--days: from 1 to {}, not {}", most_days, *given.days));
    return days(*given.days);
}

std::string in(const std::string& folder, const char* file) { return (std::filesystem::path(folder) / file).string(); }

// Names the file that it is about in every problem.
template <class Work>
auto about(const std::string& file, Work work) {
    try {
        return work();
    } catch (const problem& why) {
        throw problem(why.code(), why.name(), fmt::format("{}: {}", file, why.what()), why.advice());
    }
}

// The folder of an authority: ca.pem, ca-key.pem, revoked.pem once there is a list, and issued/ with what it signed. It
// is locked from reading to writing, so that concurrent commands lose no entry of the list.
class office {
public:
    explicit office(std::string folder) : folder_(std::move(folder)) {
        if (!is_there(in(folder_, "ca-key.pem")))
            throw problem(exit_code::failed, "no_authority",
                          fmt::format("{} is no folder of an authority: there is no ca-key.pem in it", folder_),
                          "ise keys ca SYSTEM makes one; --authority FOLDER says where it is");
        lock_ = lock_folder(folder_);
        who.certificate = read_public(in(folder_, "ca.pem"));
        who.key = read_private(in(folder_, "ca-key.pem"));
        if (is_there(in(folder_, "revoked.pem"))) who.list = read_public(in(folder_, "revoked.pem"));
    }

    pki::authority who;

    /// Keeps a copy of what was signed, for who is to be revoked later.
    void file(const std::string& certificate) const {
        auto serial = pki::describe(certificate, "the certificate").front().serial;
        make_folder(in(folder_, "issued"));
        write_new(in(in(folder_, "issued"), (serial + ".pem").c_str()), certificate, public_mode);
    }
    void keep_list() const { replace(in(folder_, "revoked.pem"), who.list, public_mode); }

    /// Every certificate that was issued to an identity, or to a name within the system.
    std::vector<std::string> issued_to(const std::string& whom) const {
        return issued([&](const std::string& text, const std::string& file) {
            auto identity = pki::describe(text, file).front().identity;
            return identity == whom || identity == "ise://" + pki::system_of(identity) + "/" + whom;
        });
    }

    /// This certificate, and every other one that was issued for its key: one that `renew` replaced is valid for long.
    std::vector<std::string> issued_with(const std::string& certificate) const {
        auto found = issued([&](const std::string& text, const std::string&) {
            return text != certificate && pki::same_key(text, certificate);
        });
        found.insert(found.begin(), certificate);
        return found;
    }

private:
    template <class Wanted>
    std::vector<std::string> issued(Wanted wanted) const {
        std::vector<std::string> found;
        std::error_code none;
        for (const auto& entry : std::filesystem::directory_iterator(in(folder_, "issued"), none)) {
            if (entry.path().extension() != ".pem") continue;
            auto text = read_public(entry.path().string());
            if (wanted(text, entry.path().string())) found.push_back(std::move(text));
        }
        return found;
    }

    std::string folder_;
    std::shared_ptr<const void> lock_;
};

// What a command says: lines for people, or a line of JSON.
struct done_line {
    std::string did, file, identity;
    if_any<std::string> until;
};

std::string done_text(const settings& set, const done_line& one, const std::string& text) {
    return set.json ? json_line(one) : text + "\n";
}

std::string make_authority(const settings& set, const keys_options& given) {
    auto valid = days_of(given, authority_days);
    auto made = pki::authority::make(given.system, now(), valid);
    make_folder(given.authority);
    auto lock = lock_folder(given.authority); // a command that finds the key waits for the certificate
    write_new(in(given.authority, "ca-key.pem"), made.key, secret_mode);
    write_new(in(given.authority, "ca.pem"), made.certificate, public_mode);
    done_line line{"ca", in(given.authority, "ca.pem"), "ise://" + given.system, iso_8601(now() + valid)};
    return done_text(set, line,
                     fmt::format("{} signs for ise://{}/ until {}; keep {} on this machine", line.file, given.system,
                                 *line.until, in(given.authority, "ca-key.pem")));
}

std::string request(const settings& set, const keys_options& given) {
    pki::system_of(given.identity);
    auto folder = given.folder.empty() ? given.identity.substr(given.identity.rfind('/') + 1) : given.folder;
    pki::subject whose;
    whose.identity = given.identity;
    whose.hosts = given.hosts;
    auto made = pki::make_request(whose);
    make_folder(folder);
    write_new(in(folder, "key.pem"), made.key, secret_mode);
    write_new(in(folder, "request.pem"), made.request, public_mode);
    done_line line{"request", in(folder, "request.pem"), given.identity, {}};
    return done_text(set, line,
                     fmt::format("{} asks for a certificate of {}{}; {} stays on this machine", line.file,
                                 given.identity, given.hosts.empty() ? ", which cannot listen (no --host)" : "",
                                 in(folder, "key.pem")));
}

// A host may request any name. The operator names the one that it may have, by the folder or by --identity.
void refuse_unexpected(const std::string& identity, const keys_options& given, const std::string& file) {
    const auto folder = std::filesystem::absolute(file).parent_path().filename().string();
    const auto last = identity.substr(identity.rfind('/') + 1);
    if (given.identity.empty() ? last == folder : identity == given.identity) return;
    throw problem(exit_code::failed, "identity",
                  fmt::format("{} asks for {}, not for {}: it is not signed", file, identity,
                              given.identity.empty() ? "a name that ends in /" + folder : given.identity),
                  fmt::format("if its host may have that name: --identity {}", identity));
}

std::string issue(const settings& set, const keys_options& given) {
    auto valid = days_of(given, given.boat ? boat_days : shore_days);
    office by(given.authority);
    std::string text;
    for (const auto& what : given.what) {
        auto file = is_folder(what) ? in(what, "request.pem") : what;
        auto folder = is_folder(what) ? what : std::filesystem::path(what).parent_path().string();
        auto target = in(folder, "certificate.pem");
        if (is_there(target))
            throw problem(exit_code::failed, "exists", fmt::format("{} is there already; it is not replaced", target),
                          "ise keys renew replaces one, with the same key");
        auto signed_now = now();
        auto made = about(file, [&] { return by.who.sign(read_public(file), signed_now, valid); });
        auto known = pki::describe(made, target).front();
        refuse_unexpected(known.identity, given, file);
        by.file(made);
        write_new(target, made, public_mode);
        replace(in(folder, "ca.pem"), by.who.trusted(), public_mode);
        done_line line{"issue", target, known.identity, iso_8601(*known.until)};
        text += done_text(set, line, fmt::format("{} is for {} until {}", target, known.identity, *line.until));
    }
    return text;
}

// One folder of `deployment`: what is there already stays.
std::string equip(const settings& set, keys_options given) {
    std::string text;
    if (!is_there(in(given.folder, "key.pem"))) text += request(set, given);
    if (is_there(in(given.folder, "certificate.pem"))) return text;
    given.what = {given.folder};
    return text + issue(set, given);
}

// All that the hosts of a deployment file and their operators need, in one folder.
std::string equip_deployment(const settings& set, const keys_options& asked) {
    auto given = asked;
    if (given.folder.empty()) given.folder = "keys";
    real_environment env;
    deployment_options which;
    which.file = given.file;
    auto parsed = read_what_there_is(env, which);
    refuse(given.file, parsed.problems);
    const auto& wanted = parsed.made;
    auto known = [&](const std::string& host) {
        if (std::ranges::find(wanted.hosts, host, &deployment::wanted_host::server) != wanted.hosts.end()) return;
        std::vector<std::string> servers;
        for (const auto& one : wanted.hosts) servers.push_back(one.server);
        throw problem(exit_code::usage, "usage",
                      fmt::format("{} has no host '{}'; it has {}", given.file, host, enumerate(servers)));
    };
    std::map<std::string, std::vector<std::string>> addresses;
    for (const auto& one : given.hosts) {
        auto [host, address] = name_and_value(one, "--host");
        known(host);
        addresses[host].push_back(address);
    }
    for (const auto& one : given.boats) known(one);
    auto every = given;
    every.system = wanted.name.text;
    pki::system_of(fmt::format("ise://{}/authority", every.system)); // a name of a system, before anything is made
    every.authority = in(given.folder, "authority");
    make_folder(given.folder);
    std::string text;
    if (!is_there(in(every.authority, "ca-key.pem"))) text += make_authority(set, every);
    auto equip_one = [&](const std::string& name, const std::string& identity, std::vector<std::string> hosts,
                         bool boat) {
        auto one = every;
        one.identity = fmt::format("ise://{}/{}", every.system, identity);
        one.folder = in(given.folder, name.c_str());
        one.hosts = std::move(hosts);
        one.boat = boat;
        text += equip(set, std::move(one));
    };
    for (const auto& host : wanted.hosts) {
        std::vector<std::string> reached{"localhost", "127.0.0.1", "::1"};
        reached.insert(reached.end(), addresses[host.server].begin(), addresses[host.server].end());
        equip_one(host.server, host.server, std::move(reached),
                  std::ranges::find(given.boats, host.server) != given.boats.end());
    }
    for (const auto& one : given.operators) {
        if (std::ranges::find(wanted.hosts, one, &deployment::wanted_host::server) != wanted.hosts.end())
            throw problem(exit_code::usage, "usage", fmt::format("'{}' is a host and cannot be an operator, too", one));
        equip_one(one, "operator/" + one, {}, false);
    }
    if (text.empty() && !set.json) text = fmt::format("{} has all of it already\n", given.folder);
    return text;
}

// A certificate, or a list, of which a third or less is left.
bool is_due(const std::string& text, const std::string& from) {
    auto due = pki::describe(text, from).front().renew_at();
    return due && now() >= *due;
}

// `news`: only of those that are due.
std::string renew_once(const settings& set, const keys_options& given, bool news) {
    office by(given.authority);
    if (!by.who.list.empty() && (given.at_once || is_due(by.who.list, "revoked.pem"))) {
        by.who.list_again(now());
        by.keep_list();
    }
    std::string text;
    for (const auto& folder : given.what) {
        auto file = in(folder, "certificate.pem");
        auto old = read_public(file);
        auto known = pki::describe(old, file).front();
        if (given.at_once || is_due(old, file)) {
            auto made = about(file, [&] { return by.who.sign_again(old, now()); });
            by.file(made);
            replace(file, made, public_mode);
            known = pki::describe(made, file).front();
            done_line line{"renew", file, known.identity, iso_8601(*known.until)};
            text += done_text(set, line, fmt::format("{} is for {} until {}", file, known.identity, *line.until));
        } else if (!news) {
            done_line line{"nothing", file, known.identity, iso_8601(*known.until)};
            text += done_text(set, line,
                              fmt::format("{} is good until {}, and renewed from {} on", file, *line.until,
                                          iso_8601(*known.renew_at())));
        }
        if (auto trusted = in(folder, "ca.pem"); !is_there(trusted) || read_public(trusted) != by.who.trusted())
            replace(trusted, by.who.trusted(), public_mode);
    }
    return text;
}

void print_now(const std::string& text) {
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
        throw problem(exit_code::no_output, "no_output", "standard output cannot be written");
}

// With --every until a signal ends it, which may be at any time: files are replaced whole.
std::string renew(const settings& set, const keys_options& given) {
    if (given.every && given.at_once)
        throw problem(exit_code::usage, "usage", "--now renews once, --every whenever it is due: give one of them");
    auto text = renew_once(set, given, false);
    if (!given.every) return text;
    for (;;) {
        print_now(text);
        std::this_thread::sleep_for(*given.every);
        text.clear();
        for (const auto& folder : given.what) { // one that cannot be written now does not keep the others back
            auto alone = given;
            alone.what = {folder};
            try {
                text += renew_once(set, alone, true);
            } catch (const problem& why) {
                report(why, set.json);
            }
        }
    }
}

std::string revoke(const settings& set, const keys_options& given) {
    auto valid = days_of(given, list_days);
    office by(given.authority);
    std::vector<std::string> all;
    std::string text;
    for (const auto& what : given.what) {
        auto certificate = is_folder(what) ? in(what, "certificate.pem") : what;
        std::vector<std::string> found;
        if (what.starts_with("ise://") || !is_there(certificate)) found = by.issued_to(what);
        else found = by.issued_with(read_public(certificate));
        if (found.empty())
            throw problem(exit_code::failed, "unknown",
                          fmt::format("'{}' is no certificate, no folder with one, and nothing was issued to it by {}",
                                      what, given.authority),
                          "ise keys show FILE says what a file is");
        for (const auto& one : found) {
            auto known = pki::describe(one, certificate).front();
            done_line line{"revoke", known.serial, known.identity, iso_8601(now() + valid)};
            text += done_text(set, line, fmt::format("revoked: {} of {}", known.serial, known.identity));
            all.push_back(one);
        }
    }
    about(fmt::format("{}", enumerate(given.what)), [&] {
        by.who.revoke(all, now(), valid);
        return 0;
    });
    by.keep_list();
    for (const auto& folder : given.into) replace(in(folder, "ca.pem"), by.who.trusted(), public_mode);
    if (set.json) return text;
    auto rest = given.into.empty() ? fmt::format("ise keys renew FOLDER puts it into the ca.pem of a host")
                                   : fmt::format("it is in the ca.pem of {}", enumerate(given.into));
    return text + fmt::format("{} lists them until {}; {}\n", in(given.authority, "revoked.pem"),
                              iso_8601(now() + valid), rest);
}

struct show_line {
    std::string file, kind, identity;
    std::vector<std::string> hosts;
    std::string subject, issuer, serial, fingerprint, public_key;
    if_any<std::string> valid_from, valid_until, renew_at;
    std::vector<std::string> revoked;
    std::string trouble;
};

std::string show(const settings& set, const keys_options& given) {
    std::vector<show_line> lines;
    std::string text;
    for (const auto& what : given.what) {
        std::vector<std::string> files{what};
        if (is_folder(what)) {
            files.clear();
            for (const char* file : {"ca.pem", "certificate.pem", "request.pem", "key.pem"})
                if (is_there(in(what, file))) files.push_back(in(what, file));
            if (files.empty())
                throw problem(exit_code::failed, "nothing",
                              fmt::format("{} has none of ca.pem, certificate.pem, "
                                          "request.pem and key.pem",
                                          what));
        }
        for (const auto& file : files) {
            // A private key is only named: what it is, never what is in it.
            for (auto& one : pki::describe(read_public(file), file)) {
                if (one.trouble.empty() && one.from && now() < *one.from) one.trouble = "it is not valid yet";
                if (one.trouble.empty() && one.until && now() >= *one.until)
                    one.trouble = one.kind == "revocation list" ? "it is out of date: peers are refused because of it"
                                                                : "it has expired";
                show_line line;
                line.file = file;
                line.kind = one.kind;
                line.identity = one.identity;
                line.hosts = one.hosts;
                line.subject = printable(one.subject);
                line.issuer = printable(one.issuer);
                line.serial = one.serial;
                line.fingerprint = one.fingerprint;
                line.public_key = one.public_key;
                if (one.from) line.valid_from = iso_8601(*one.from);
                if (one.until) line.valid_until = iso_8601(*one.until);
                if (one.kind == "certificate") line.renew_at = iso_8601(*one.renew_at());
                line.revoked = one.revoked;
                line.trouble = one.trouble;
                text += fmt::format("{}: {}\n", file, one.kind);
                auto say = [&](std::string_view name, const std::string& value) {
                    if (!value.empty()) text += fmt::format("  {:<12} {}\n", name, printable(value));
                };
                say("identity", one.identity);
                say("hosts", enumerate(one.hosts));
                say("subject", one.subject);
                say("issuer", one.issuer);
                say("serial", one.serial);
                say("SHA-256", one.fingerprint);
                say("key", one.public_key);
                say("valid from", line.valid_from.value_or(""));
                say("valid until", line.valid_until.value_or(""));
                say("renewed from", line.renew_at.value_or(""));
                if (one.kind == "revocation list")
                    say("revoked", one.revoked.empty() ? "nothing" : enumerate(one.revoked));
                say("trouble", one.trouble);
                lines.push_back(std::move(line));
            }
        }
    }
    return set.json ? json_line(lines) : text;
}

using keys_action = std::string (*)(const settings&, const keys_options&);

command_line::app* add_action(command_line::app& app, parsed_command& made, const std::shared_ptr<keys_options>& given,
                              const char* name, const char* summary, keys_action act) {
    auto* added = app.add_subcommand(name, summary);
    added->group("Actions");
    added->callback([&made, given, act] { made.text = act(made.set, *given); });
    return added;
}

void add_authority(command_line::app& to, keys_options& given) {
    to.add_option("--authority", given.authority, "its folder (default: authority)")->type_name("FOLDER");
}

void add_days(command_line::app& to, keys_options& given, const char* description) {
    to.add_option("--days", given.days, description)->type_name("N");
}

void declare_keys(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<keys_options>();
    app.require_subcommand(1);
    auto* ca = add_action(app, made, given, "ca", "makes an authority, which signs for a system", make_authority);
    ca->add_option("SYSTEM", given->system, "its name: identities are ise://SYSTEM/NAME")->required();
    add_authority(*ca, *given);
    add_days(*ca, *given, "for which it is valid (default: 3650)");

    auto* ask =
        add_action(app, made, given, "request", "makes a private key and a request for its certificate", request);
    ask->add_option("IDENTITY", given->identity, "ise://SYSTEM/NAME")->required();
    add_each(*ask, "--host", given->hosts, "a name or address by which peers reach it; may be repeated", "HOST");
    ask->add_option("--folder", given->folder, "where they are put (default: the last part of the name)")
        ->type_name("FOLDER");

    auto* sign = add_action(app, made, given, "issue", "signs requests: certificate.pem and ca.pem beside them", issue);
    sign->add_option("REQUEST", given->what, "a request, or the folder with request.pem")->required();
    add_authority(*sign, *given);
    add_days(*sign, *given, "for which they are valid (default: 30)");
    sign->add_option("--identity", given->identity,
                     "the identity that the request must have (default: one that ends in the name of its folder)")
        ->type_name("ISE://SYSTEM/NAME");
    sign->add_flag("--boat", given->boat, "valid for 400 days, for hosts that cannot be reached");

    auto* again = add_action(app, made, given, "renew",
                             "issues certificates again of which two thirds have passed, with the same key", renew);
    again->add_option("FOLDER", given->what, "with certificate.pem")->required();
    add_authority(*again, *given);
    again->add_flag("--now", given->at_once, "also if less has passed");
    add_time(*again, "--every", given->every, "goes on, and looks again after this time (12h)");

    auto* all = add_action(app, made, given, "deployment",
                           "makes an authority, and key and certificate of each host of a deployment file and of "
                           "operators; what is there already stays",
                           equip_deployment);
    all->add_option("FILE", given->file, "the deployment file; its name is the system's")->required();
    add_each(*all, "--operator", given->operators, "a person; may be repeated", "NAME");
    add_each(*all, "--host", given->hosts,
             "a name or address by which peers reach a host of the file, beside loopback; may be repeated",
             "HOST=ADDRESS");
    add_each(*all, "--boat", given->boats, "a host that cannot be reached, valid for 400 days; may be repeated",
             "HOST");
    all->add_option("--folder", given->folder, "a folder below which each has one (default: keys)")
        ->type_name("FOLDER");

    auto* no = add_action(app, made, given, "revoke", "adds certificates to the list of revoked ones", revoke);
    no->add_option("WHAT", given->what, "an identity or its name, a certificate, or a folder with one")->required();
    add_authority(*no, *given);
    add_days(*no, *given, "until which the list is valid (default: 400)");
    add_each(*no, "--into", given->into, "the folder of a host, whose ca.pem gets the list; may be repeated", "FOLDER");

    auto* look =
        add_action(app, made, given, "show", "what a file is: whose, by whom, how long; never a private key", show);
    look->add_option("FILE", given->what, "a file, or a folder of a host")->required();
}

} // namespace

extern const command keys_command{"keys", deploy_group, "makes, renews and revokes the certificates of a system",
                                  "  ise keys ca robots\n"
                                  "  ise keys request ise://robots/shore --host shore.local --host 192.168.1.5\n"
                                  "  ise keys issue shore\n"
                                  "  ise keys revoke laptop --into shore --into boat\n"
                                  "  ise keys deployment atirma.toml --operator ana\n",
                                  declare_keys};

} // namespace ise::cli
