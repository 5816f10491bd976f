#include <ise/component/parameter_services.hpp>
#include <ise/instantiation/access.hpp>
#include <ise/instantiation/changes.hpp>
#include <ise/instantiation/differences.hpp>
#include <ise/instantiation/refusal.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace ise::instantiation {
namespace {

constexpr duration parameter_wait = std::chrono::seconds(5);

bool runs(const supervision& watch) { return watch.state() == instance_state::ready; }

// What a component said, without whom was asked for what: that goes before it once more on the way to who asked us.
std::string said(const std::string& message, std::string_view service) {
    auto end = message.starts_with(fmt::format("'{}' at ", service)) ? message.find(": ") : std::string::npos;
    return end == std::string::npos ? message : message.substr(end + 2);
}

[[noreturn]] void refuse_restart(const instance& which, const std::vector<difference>& wanted, const type_info& type) {
    for (const auto& one : wanted) {
        if (one.in_place) continue;
        std::vector<std::string> others;
        for (const auto& each : type.parameters)
            if (each.changeable) others.push_back(each.name);
        throw error(
            errc::invalid_argument,
            fmt::format(
                "parameter '{}' of '{}' cannot be changed while it runs, {}: to start it again with another value, "
                "write that into its deployment file and ise up, or ise stop and ise start it",
                one.what, which.plan.path,
                others.empty() ? "and neither can its others" : fmt::format("only {}", fmt::join(others, ", "))));
    }
    throw error(errc::refused, fmt::format("'{}' does not run: {}", which.plan.path, which.watch.reason()));
}

} // namespace

task<change_response> changes::change(change_request what, const verified_peer* by) {
    change_response refused;
    auto to = std::move(what.to);
    if (what.undo != 0) {
        auto one = table_.at(to.path);
        if (!one->former || one->undo != what.undo)
            throw error(errc::refused,
                        fmt::format("the change of '{}' cannot be undone: it was changed again since", to.path));
        to = *one->former;
    }
    try {
        auto response = co_await change_to(std::move(to), false, by);
        co_return response;
    } catch (const error& why) {
        if (why.code() == errc::access_denied || why.code() == errc::refused)
            throw; // there is no such instance, or it has something against it
        refused.outcome = starting_.refused(why);
    }
    co_return refused;
}

task<change_response> changes::change_to(start_request to, bool only_in_place, const verified_peer* by) {
    check_wishes(to, here_.options.rules);
    auto wanted = to;
    auto planned = co_await types_.plan(std::move(wanted));
    auto one = table_.at(planned.path);
    if (!only_in_place) {
        check_access(here_, by, access::action::stop, planned.path, one->asked.type);
        check_start(here_, by, planned.path, to);
        if (to.roles != one->asked.roles) check_roles(here_, by, to.roles);
    }
    shared_.check(to.process, planned.program);
    if (!changing_.insert(planned.path).second)
        throw error(errc::refused, fmt::format("'{}' is being changed already: try again", planned.path));
    struct changing { // whichever way this coroutine ends
        std::set<std::string>& all;
        std::string path;
        ~changing() { all.erase(path); }
    } guard{changing_, planned.path};
    instances_.check_room(to);
    change_response made;
    made.former = one->asked;
    for (auto& variable : made.former.variables) variable.value.clear(); // secrets stay here
    // To set a parameter is no reason to run another program.
    auto is = only_in_place ? one->text() : table_.info_of(*one);
    auto others = differences(is, to, *types_.known().find(to.type), one->other_environment(to));
    bool in_place = std::ranges::all_of(others, &difference::in_place);
    if (in_place && runs(one->watch)) {
        std::vector<argument> settings;
        for (auto& other : others)
            if (other.setting) settings.push_back(*other.setting);
        if (!settings.empty()) {
            auto taken = co_await set_parameters(one, std::move(settings));
            if (!taken) throw error(taken.error());
            if (table_.find(one->plan.path) != one)
                throw error(errc::refused, fmt::format("'{}' was forgotten while it was changed", one->plan.path));
        }
        if (!others.empty()) made.way = change_way::in_place;
        if (!others.empty() || one->asked.deployment != to.deployment) {
            become(one, std::move(to), std::move(planned));
            made.undo = one->undo;
        }
        made.outcome.started = one->text();
        co_return made;
    }
    if (only_in_place) refuse_restart(*one, others, *types_.known().find(to.type));
    starting_.check_rate();
    made.way = change_way::restarted;
    auto asked = one->asked;
    auto former = one->plan;
    bool was_up = runs(one->watch);
    become(one, std::move(to), std::move(planned));
    made.undo = one->undo;
    if (is.rebuilt) shared_.replace_that_of(*one);
    auto stops = one->watch.stops();
    instances_.carry_out(one, one->watch.restart(here_.self.now()));
    try {
        made.outcome = co_await starting_.until_ready(one);
    } catch (...) { // whoever asked for it has given up
        bool undone = !here_.stopping && !runs(one->watch) && table_.goes_on(one, stops);
        if (undone && !was_up) starting_.give_up(one);
        if (undone) roll_back(one, std::move(asked), std::move(former), was_up);
        throw;
    }
    if (made.outcome.outcome == start_outcome::ready) co_return made;
    made.undo = 0;
    if (table_.find(one->plan.path) != one) co_return made; // it was forgotten
    bool stopped = !table_.goes_on(one, stops);             // the last word
    bool again = was_up && !stopped;
    roll_back(one, std::move(asked), std::move(former), again);
    if (stopped) made.outcome.why += "; it was stopped meanwhile";
    if (again) {
        auto back = co_await starting_.until_ready(one);
        made.outcome.why += back.outcome == start_outcome::ready
                                ? "; it runs again as before"
                                : fmt::format("; nor does it start again as before: {}", back.why);
    }
    made.outcome.started = one->text();
    co_return made;
}

task<set_response> changes::set(set_request what) {
    auto one = table_.at(what.path);
    auto to = one->asked;
    to.arguments = with_settings(std::move(to.arguments), what.settings);
    set_response made;
    try {
        auto changed = co_await change_to(std::move(to), true, nullptr);
        made.instance = changed.outcome.started;
    } catch (const error& why) {
        if (why.code() != errc::invalid_argument) throw;
        throw error(errc::refused, why.what()); // of what was asked for: as such it reaches the caller
    }
    if (auto kept = state_.saved(); !kept)
        throw error(errc::refused, fmt::format("'{}' has the new value, which is lost with this instantiation server, "
                                               "because the state is not on disk: {}; set it again",
                                               what.path, kept.error().message()));
    co_return made;
}

task<result<void>> changes::set_parameters(instance_ptr one, std::vector<argument> settings) {
    change_parameters_request request;
    for (auto& [name, value] : settings) request.settings.push_back({std::move(name), std::move(value)});
    auto who = here_.self.at(one->plan.path);
    auto response = co_await who.try_call(change_parameters_service, std::move(request), parameter_wait);
    if (response) co_return result<void>();
    // It threw: that is a refusal, too.
    bool its_own = response.error().code() == errc::handler_failed || response.error().code() == errc::refused;
    if (!its_own) co_return response.error();
    co_return failure(errc::refused, fmt::format("{} refuses it: {}", one->plan.path,
                                                 said(response.error().message(), change_parameters_service.name())));
}

void changes::become(const instance_ptr& one, start_request asked, launch_plan plan) {
    bool elsewhere = one->asked.process != asked.process;
    if (elsewhere) one->output = table_.output_of(plan.path, asked.process);
    one->former = std::exchange(one->asked, std::move(asked));
    one->undo = here_.self.env().random() | 1;
    one->plan = std::move(plan);
    one->watch.use(one->asked.terms);
    probes_.begin(one);
    instances_.announce(*one);
}

void changes::roll_back(const instance_ptr& one, start_request asked, launch_plan plan, bool again) {
    become(one, std::move(asked), std::move(plan));
    if (again) instances_.carry_out(one, one->watch.restart(here_.self.now()));
}

} // namespace ise::instantiation
