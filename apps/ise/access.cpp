// ise access: what an access policy says, and which one components have.
#include "access_learn.hpp"
#include "json.hpp"
#include "options.hpp"
#include "survey.hpp"
#include "table.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/access/policy.hpp>
#include <ise/component/access_services.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/core/time_text.hpp>
#include <ise/naming/services.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace ise::cli {
namespace {

struct access_options {
    std::string act;
    std::vector<std::string> words;
    std::vector<std::string> serves;
    bool live = false;
    learn_options learn;
};

struct remark_line {
    std::string file;
    std::uint32_t line = 0, column = 0;
    std::string text;
};
struct checked_policy {
    std::string file, hash, system;
    std::uint64_t rules = 0;
    std::vector<remark_line> remarks;
};
struct verdict_line {
    std::string who, what;
    bool allowed = false;
    std::string rule, reason;
};
struct policy_line {
    std::string component;
    std::string file, hash, read_at, identity;
    bool differs = false;
    std::string problem;
};

problem unusable(const std::string& file, const std::vector<access::remark>& problems) {
    std::string text;
    for (const auto& one : problems)
        text += fmt::format("{}{}:{}:{}: {}", text.empty() ? "" : "\n", file, one.line, one.column, one.text);
    return problem(exit_code::usage, "invalid_policy", text, "docs/access.md describes the file");
}

std::shared_ptr<const access::policy> policy_in(const std::string& file) {
    real_environment env;
    auto text = env.read_file(file, access::policy::max_bytes);
    if (!text) throw problem(exit_code::usage, "usage", text.error().message());
    std::vector<access::remark> problems;
    auto made = access::policy::parse(*text, file, problems);
    if (!made) throw unusable(file, problems);
    return made;
}

// --- check --------------------------------------------------------------------------------------------------------

bool gives_nothing(const access::rule& one) {
    return one.call.empty() && one.subscribe.empty() && one.read.empty() && one.name.empty() && one.roles.empty() &&
           one.set.empty() && one.hosts.empty();
}

// Rules that have no effect.
std::vector<access::remark> oddities(const access::policy& of) {
    std::vector<access::remark> found;
    auto add = [&](std::uint32_t line, std::string text) { found.push_back({line, 1, std::move(text)}); };
    auto each = [&](const access::rule& one, access::action what, const std::vector<access::target>& all) {
        for (const auto& target : all) {
            if (!one.allows || !target.path.plain() || !target.item.plain()) continue;
            const std::string path[] = {target.path.text()};
            access::request wanted;
            wanted.what = what;
            wanted.targets = path;
            wanted.item = target.item.text();
            bool denied = !one.who.empty() && std::ranges::all_of(one.who, [&](const access::subject& who) {
                return who.of.plain() && of.decide(who.nobody ? "" : who.of.text(), wanted).denied;
            });
            if (denied)
                add(target.line, fmt::format("'{}:{}' is allowed here and denied by another rule", target.path.text(),
                                             target.item.text()));
        }
    };
    for (const auto& one : of.rules()) {
        if (one.who.empty()) add(one.line, "this rule is about nobody: its 'who' is empty");
        else if (gives_nothing(one))
            add(one.line, "this rule says nothing: it has none of call, subscribe, read, name, role, set and host");
        each(one, access::action::call, one.call);
        each(one, access::action::subscribe, one.subscribe);
        each(one, access::action::set, one.set);
    }
    return found;
}

// Names in the rules that no running component has.
std::vector<access::remark> missing(const access::policy& of, const std::vector<surveyed>& all) {
    std::vector<access::remark> found;
    auto each = [&](const std::vector<access::target>& targets, service_kind kind) {
        for (const auto& target : targets) {
            bool known = std::ranges::any_of(all, [&](const surveyed& one) {
                if (!one.about) return false;
                std::vector<std::string> titles{one.about->path};
                for (const auto& [role, priority] : one.about->roles) titles.push_back(role);
                bool here = std::ranges::any_of(titles, [&](const auto& title) { return target.path.matches(title); });
                return here && std::ranges::any_of(one.about->services, [&](const service_info& service) {
                           return service.provided && service.kind == static_cast<std::uint8_t>(kind) &&
                                  target.item.matches(service.name);
                       });
            });
            if (!known)
                found.push_back(
                    {target.line, 1,
                     fmt::format("no component that runs now has '{}:{}'", target.path.text(), target.item.text())});
        }
    };
    for (const auto& one : of.rules()) {
        each(one.call, service_kind::request_response);
        each(one.subscribe, service_kind::subscription);
    }
    return found;
}

std::string as_text(const settings& set, const access::policy& of, std::vector<access::remark> remarks) {
    std::ranges::stable_sort(remarks, {}, &access::remark::line);
    if (set.json) {
        checked_policy result{of.file(), of.hash(), of.system(), of.rules().size(), {}};
        for (auto& one : remarks) result.remarks.push_back({of.file(), one.line, one.column, std::move(one.text)});
        return json_line(result);
    }
    std::string text;
    for (const auto& one : remarks) text += fmt::format("{}:{}: {}\n", of.file(), one.line, one.text);
    return text + fmt::format("{} can be used: {} rule{}, hash {}\n", of.file(), of.rules().size(),
                              of.rules().size() == 1 ? "" : "s", of.hash());
}

task<> check_live(context& in, std::shared_ptr<const access::policy> of) {
    survey_options everything;
    auto all = co_await survey(in, everything);
    auto remarks = oddities(*of);
    auto more = missing(*of, all);
    remarks.insert(remarks.end(), more.begin(), more.end());
    auto text = as_text(in.set, *of, std::move(remarks));
    co_await in.out.write(in.self, std::move(text));
}

// --- why ----------------------------------------------------------------------------------------------------------

problem wrong_what(access::action what, const std::string& given) {
    std::string_view form = "PATH";
    switch (what) {
        case access::action::call:
        case access::action::subscribe: form = "PATH:SERVICE"; break;
        case access::action::set: form = "PATH:PARAMETER"; break;
        case access::action::role: form = "ROLE=PRIORITY"; break;
        case access::action::start:
        case access::action::stop: form = "HOST:PATH, HOST:PATH=TYPE or HOST:PATH=TYPE,identity=NAME,user=NAME"; break;
        default: break;
    }
    return problem(
        exit_code::usage, "usage",
        fmt::format("'{}' is not what can be asked of '{}': write {}", printable(given), access::name_of(what), form));
}

/// A request with what it borrows.
struct asked {
    access::request request;
    std::vector<std::string> targets;
    std::string item, host, type, identity, user;
};

std::unique_ptr<asked> read_request(const access_options& options) {
    auto made = std::make_unique<asked>();
    auto what = access::parse_action(options.words[1]);
    if (!what) throw problem(exit_code::usage, "usage", what.error().message());
    auto text = options.words[2];
    auto& request = made->request;
    request.what = *what;
    auto cut = [&](char at, std::string& rest, bool needed) {
        auto found = text.rfind(at);
        if (found == text.npos) {
            if (needed) throw wrong_what(*what, options.words[2]);
            return;
        }
        rest = text.substr(found + 1);
        text.erase(found);
    };
    switch (*what) {
        case access::action::call:
        case access::action::subscribe:
        case access::action::set: cut(':', made->item, true); break;
        case access::action::role: {
            std::string number;
            cut('=', number, true);
            auto end = number.data() + number.size();
            auto [last, trouble] = std::from_chars(number.data(), end, request.priority);
            if (trouble != std::errc() || last != end) throw wrong_what(*what, options.words[2]);
            break;
        }
        case access::action::start:
        case access::action::stop: {
            for (auto comma = text.rfind(','); comma != text.npos; comma = text.rfind(',')) {
                auto word = text.substr(comma + 1);
                text.erase(comma);
                if (word.starts_with("identity=")) made->identity = word.substr(9);
                else if (word.starts_with("user=")) made->user = word.substr(5);
                else throw wrong_what(*what, options.words[2]);
            }
            cut('=', made->type, false);
            auto colon = text.find(':');
            if (colon == text.npos) throw wrong_what(*what, options.words[2]);
            made->host = text.substr(0, colon);
            text.erase(0, colon + 1);
            break;
        }
        default: break;
    }
    if (text.empty()) throw wrong_what(*what, options.words[2]);
    made->targets = options.serves;
    made->targets.insert(made->targets.begin(), text);
    if (*what == access::action::call || *what == access::action::subscribe)
        request = access::request_for(*what == access::action::subscribe, made->targets, made->item);
    request.targets = made->targets;
    if (request.what == *what) request.item = made->item;
    if (!made->host.empty()) request.host = made->host;
    request.type = made->type;
    request.identity = made->identity;
    request.user = made->user;
    return made;
}

std::string why(const settings& set, const access_options& options) {
    auto file = set.security.access_file;
    if (file.empty()) {
        real_environment env;
        file = env.variable("ISE_ACCESS").value_or("");
    }
    if (file.empty())
        throw problem(exit_code::usage, "usage", "which policy? --access FILE or ISE_ACCESS",
                      "ise --access access.toml access why ise://atirma/web call atirma/boat:helm");
    auto policy = policy_in(file);
    auto wanted = read_request(options);
    const auto& who = options.words[0];
    auto said = policy->decide(who == "nobody" ? "" : who, wanted->request);
    verdict_line result{who, fmt::format("{} {}", options.words[1], options.words[2]), said.allowed, {}, {}};
    if (said.line != 0) result.rule = fmt::format("{}:{}", file, said.line);
    result.reason = said.allowed ? "allowed" : said.denied ? "denied by that rule" : "no rule allows it";
    if (set.json) return json_line(result);
    return fmt::format("{}: {}{}\n", said.allowed ? "allowed" : "denied", result.rule.empty() ? "" : result.rule + ": ",
                       said.allowed  ? fmt::format("{} may {}", who, result.what)
                       : said.denied ? fmt::format("{} may not {}", who, result.what)
                                     : fmt::format("no rule of {} lets {} {}", file, who, result.what));
}

// --- list ---------------------------------------------------------------------------------------------------------

task<> ask_policy(context in, std::string path, std::shared_ptr<std::vector<policy_line>> into,
                  std::shared_ptr<std::size_t> open, waiter<>* done) {
    policy_line made;
    made.component = path;
    try {
        remote who; // the name server has no name in itself
        if (path == naming::server_path) who = co_await reach_name_server(in);
        else who = co_await reach(in, path);
        access_request question;
        auto response = co_await who.try_call(access_service, question, in.left());
        if (response) {
            made.file = response->file;
            made.hash = response->hash;
            made.read_at = iso_8601(response->read_at);
            made.identity = response->who;
            made.problem = response->problem;
        } else if (response.error().code() == errc::no_such_service) {
            made.problem = "it has no access policy: everything is allowed there";
        } else {
            made.problem = response.error().message();
        }
    } catch (const problem& why) {
        made.problem = why.what();
    } catch (const error& why) {
        made.problem = why.what();
    }
    into->push_back(std::move(made));
    if (--*open == 0) done->resume();
}

task<> list_policies(context& in) {
    auto names = co_await listed_names(in, "");
    auto all = std::make_shared<std::vector<policy_line>>();
    auto open = std::make_shared<std::size_t>(names.size() + 1);
    waiter<> done(in.self.on());
    auto one_at = in;
    one_at.until = in.self.now() + in.set.timeout / 2;
    in.self.spawn("policy", ask_policy(one_at, std::string(naming::server_path), all, open, &done));
    for (const auto& one : names) in.self.spawn("policy", ask_policy(one_at, one.path, all, open, &done));
    while (*open > 0) co_await done.wait();
    std::ranges::sort(*all, {}, &policy_line::component);
    std::map<std::string, std::size_t> hashes;
    for (const auto& one : *all)
        if (!one.hash.empty()) ++hashes[one.hash];
    auto usual = std::ranges::max_element(hashes, {}, [](const auto& one) { return one.second; });
    bool differ = false;
    for (auto& one : *all) {
        one.differs = usual != hashes.end() && one.hash != usual->first;
        differ = differ || one.differs;
    }
    std::string text;
    if (in.set.json) {
        text = json_line(*all);
    } else {
        table rows({"COMPONENT", "HASH", "READ AT", "IDENTITY", ""});
        for (const auto& one : *all)
            rows.add({one.component, one.hash.empty() ? "-" : one.hash, one.read_at.empty() ? "-" : one.read_at,
                      one.identity.empty() ? "-" : one.identity,
                      !one.problem.empty() ? one.problem
                      : one.differs        ? "differs from most"
                                           : ""});
        text = rows.text(in.out.width());
    }
    co_await in.out.write(in.self, std::move(text));
}

void need(const access_options& options, std::size_t count, const char* form) {
    if (options.words.size() != count)
        throw problem(exit_code::usage, "usage", fmt::format("ise access {} requires {}", options.act, form),
                      "ise access --help");
}

void declare_access(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<access_options>();
    app.add_option("ACTION", given->act, "check, why, list or learn")
        ->required()
        ->check(one_of({"check", "learn", "list", "why"}));
    app.add_option("WORDS", given->words, "of check: FILE; of why: WHO DO WHAT");
    app.add_flag("--live", given->live, "of check: also whether the components that run have what the rules name");
    add_each(app, "--serves", given->serves, "of why: a role that the component serves", "ROLE");
    auto& learn = given->learn;
    add_time(app, "--for", learn.length, "of learn: how long it watches (default: until Ctrl-C)");
    app.add_option("-o,--out", learn.out, "of learn: the file for the policy (default: standard output)")
        ->type_name("FILE");
    app.add_flag("--force", learn.force, "of learn: in place of a file that is there");
    app.callback([&made, given] {
        if (given->act == "learn") {
            need(*given, 0, "nothing more");
            check_learned_file(given->learn);
            made.endless = true;
            made.looks = true;
            made.work = [given](context& in) { return learn_access(in, given->learn); };
            return;
        }
        if (given->learn.length || !given->learn.out.empty() || given->learn.force)
            throw problem(exit_code::usage, "usage", "--for, --out and --force are of ise access learn");
        if (given->act == "check") {
            need(*given, 1, "a FILE");
            auto policy = policy_in(given->words[0]);
            if (given->live) made.work = [policy](context& in) { return check_live(in, policy); };
            else made.text = as_text(made.set, *policy, oddities(*policy));
            made.looks = given->live;
            return;
        }
        if (given->act == "why") {
            need(*given, 3, "WHO DO WHAT, such as ise://atirma/web call atirma/boat:helm");
            made.text = why(made.set, *given);
            return;
        }
        need(*given, 0, "nothing more");
        made.looks = true;
        made.work = [](context& in) { return list_policies(in); };
    });
}

} // namespace

extern const command access_command{
    "access", see_group, "checks an access policy, says why something is allowed, learns one from a running system",
    "  ise access check access.toml --live\n"
    "  ise --access access.toml access why ise://atirma/web call atirma/communication:telecommand\n"
    "  ise access list\n"
    "  ise access learn --for 10m --out access.toml    what is used meanwhile is allowed, and nothing else\n",
    declare_access};

} // namespace ise::cli
