// ise access learn: an access policy from what is used in a running system.
#include "access_learn.hpp"

#include "json.hpp"
#include "keys_files.hpp"
#include "learning.hpp"
#include "options.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/core/loop.hpp>
#include <ise/core/time_text.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>

#include <fmt/format.h>

#include <map>
#include <optional>
#include <set>
#include <utility>

namespace ise::cli {
namespace {

constexpr duration look_every = std::chrono::seconds(1);

struct learned_answer {
    std::string file; ///< empty: `policy` has the text
    std::string policy;
    std::uint64_t looks = 0, failed_looks = 0, components = 0, rules = 0;
    std::vector<std::string> unknown;
};

std::map<std::string, std::set<std::string>> identities_here(component& self) {
    std::map<std::string, std::set<std::string>> made;
    for (const auto& [raw, held] : self.services().sessions())
        if (!held->peer().path.empty() && !held->verified().same_process)
            made[held->peer().path].insert(held->verified().who);
    return made;
}

task<> look_once(context& in, learning& into) {
    in.until = saturating_add(in.self.now(), in.set.timeout);
    survey_options everything;
    auto all = co_await survey(in, everything);
    auto server = co_await reach_name_server(in);
    surveyed names;
    names.name.path = naming::server_path;
    names.about = co_await ask_about(in, server); // it is not registered, and knows who registers
    all.push_back(std::move(names));
    into.look(all, identities_here(in.self));
}

} // namespace

void check_learned_file(const learn_options& options) {
    if (options.out.empty() || options.force || !is_there(options.out)) return;
    throw problem(exit_code::failed, "exists", fmt::format("{} is there already; it is not replaced", options.out),
                  "--force replaces it");
}

task<> learn_access(context& in, learn_options options) {
    learning seen;
    bool over = false;
    waiter<> pause(in.self.on());
    auto finish = [&over, &pause] {
        over = true;
        pause.resume();
    };
    timer end(in.self.on(), finish);
    timer next(in.self.on(), [&pause] { pause.resume(); });
    const auto began = in.self.now();
    co_await look_once(in, seen); // what is wrong from the start is an error
    in.ctrl_c.care(in.self.on(), finish);
    note(in.set, fmt::format("watching {} component{}{}; Ctrl-C ends it and writes the policy", seen.components(),
                             seen.components() == 1 ? "" : "s",
                             options.length ? " for " + show_duration(*options.length) : std::string()));
    if (options.length) end.arm(saturating_add(began, *options.length));
    std::uint64_t failed = 0;
    while (!over) {
        next.arm(saturating_add(in.self.now(), look_every));
        co_await pause.wait();
        std::string trouble;
        try {
            co_await look_once(in, seen); // at the end once more
        } catch (const problem& why) {
            trouble = why.what();
        } catch (const error& why) {
            trouble = why.what();
        }
        if (!trouble.empty() && failed++ == 0) note(in.set, "a look failed, it goes on: " + trouble);
    }
    in.ctrl_c.leave();
    auto outcome = seen.outcome();
    if (outcome.needed.empty())
        throw problem(exit_code::failed, "nothing_seen",
                      "nothing was seen that a policy could allow, and an empty one forbids everything",
                      "ise graph shows what is used now");
    learned_head head{iso_8601(in.self.wall()), show_duration(in.self.now() - began), seen.looks(), seen.components()};
    auto text = policy_text(outcome, head);
    if (auto wrong = objection_to_policy(text, outcome); !wrong.empty())
        throw problem(exit_code::failed, "unexpected", "the policy that was made cannot be used: " + wrong);
    if (!options.out.empty()) {
        if (options.force) replace(options.out, text, public_mode);
        else write_new(options.out, text, public_mode);
    }
    std::set<std::string> identities;
    for (const auto& [one, sources] : outcome.needed) identities.insert(one.who);
    learned_answer result{options.out, {}, seen.looks(), failed, seen.components(), identities.size(), outcome.unknown};
    std::string shown = text;
    if (in.set.json) {
        if (options.out.empty()) result.policy = std::move(text);
        shown = json_line(result);
    } else if (!options.out.empty()) {
        shown = fmt::format("{}: {} rule{}, from {} looks at {} component{}\n", printable(options.out), result.rules,
                            result.rules == 1 ? "" : "s", result.looks, result.components,
                            result.components == 1 ? "" : "s");
    }
    co_await in.out.write(in.self, std::move(shown));
    if (!outcome.unknown.empty())
        note(in.set, fmt::format("{} use{} could not be seen in full: the comments at the beginning of the policy say "
                                 "what to look after",
                                 outcome.unknown.size(), outcome.unknown.size() == 1 ? "" : "s"));
}

} // namespace ise::cli
