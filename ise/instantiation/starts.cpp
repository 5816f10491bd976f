#include <ise/instantiation/access.hpp>
#include <ise/instantiation/refusal.hpp>
#include <ise/instantiation/start_checks.hpp>
#include <ise/instantiation/starts.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::instantiation {
namespace {

constexpr std::size_t shown_lines = 12;

} // namespace

task<start_response> starts::start(start_request request, const verified_peer* by) {
    start_response instead;
    try {
        auto response = co_await begin(std::move(request), by);
        co_return response;
    } catch (const error& why) {
        if (why.code() == errc::access_denied) throw;
        instead = refused(why);
    }
    co_return instead;
}

task<start_response> starts::begin(start_request request, const verified_peer* by) {
    check_wishes(request, here_.options.rules);
    auto wanted = request;
    auto what = co_await types_.plan(std::move(wanted));
    check_start(here_, by, what.path, request);
    check_roles(here_, by, request.roles);
    shared_.check(request.process, what.program);
    check_room(what.path);
    check_rate();
    co_await names_.check_free(what.path);
    check_room(what.path); // others may have come meanwhile
    check_endpoints(here_.self, what.listen);
    instances_.check_room(request);
    auto one = instances_.add(std::move(request), std::move(what));
    if (table_.prints_alone(*one)) one->output->remove();
    instances_.carry_out(one, one->watch.start(here_.self.now()));
    auto life = one->life;
    try {
        auto response = co_await until_ready(one);
        co_return response;
    } catch (...) { // whoever asked for it has given up
        if (one->life == life) give_up(one);
        throw;
    }
}

task<start_response> starts::restart(std::string path) {
    auto one = table_.at(path);
    start_response instead;
    try {
        auto response = co_await begin_again(one);
        co_return response;
    } catch (const error& why) {
        instead = refused(why);
    }
    co_return instead;
}

task<start_response> starts::begin_again(instance_ptr one) {
    check_rate();
    auto stops = one->watch.stops();
    co_await types_.refresh();
    if (!table_.goes_on(one, stops))
        throw error(errc::refused, fmt::format("'{}' was stopped while its restart began", one->plan.path));
    auto asked = one->asked_again();
    auto objection = objection_to_own(asked, here_.options.rules);
    if (!objection.empty()) throw error(errc::invalid_argument, objection); // it runs on
    one->plan = types_.known().plan(asked, here_.options.rules, here_.self.env().random()).value();
    instances_.carry_out(one, one->watch.restart(here_.self.now()));
    auto response = co_await until_ready(one);
    co_return response;
}

void starts::give_up(const instance_ptr& one) {
    if (here_.stopping || one->watch.state() != instance_state::starting) return;
    instances_.carry_out(one,
                         one->asked.process.empty()
                             ? one->watch.kill(here_.self.now())
                             : one->watch.stop(here_.self.now(), one->asked.terms.grace)); // others share its process
}

task<start_response> starts::until_ready(instance_ptr one) {
    auto life = one->life;
    while (one->watch.state() == instance_state::starting || one->watch.state() == instance_state::stopping)
        co_await next_change(here_.self.on(), one);
    start_response made;
    made.started = one->text();
    if (one->watch.state() == instance_state::ready) co_return made;
    bool launched = one->launched_life >= life;
    made.outcome = !launched           ? start_outcome::not_launched
                   : one->watch.late() ? start_outcome::deadline
                                       : start_outcome::exited;
    made.why = fmt::format("'{}' did not start: {}", one->plan.path, one->watch.reason());
    if (one->watch.late() && !one->obstacle.empty()) made.why += fmt::format(" ({})", one->obstacle);
    if (launched) made.output = one->output->last_lines(shown_lines);
    co_return made;
}

void starts::check_room(const std::string& path) {
    auto here = table_.find(path);
    if (here && !here->watch.over())
        throw error(
            errc::name_taken,
            fmt::format(
                "'{}' runs here already, as process {}: restart it, stop it first, or start another under another path",
                path, here->running ? here->running->stamp().pid : 0));
    const auto& all = table_.instances();
    if (here || all.size() < here_.options.max_instances) return;
    auto oldest = all.end();
    for (auto at = all.begin(); at != all.end(); ++at)
        if (at->second->watch.over() && (oldest == all.end() || at->second->since < oldest->second->since)) oldest = at;
    if (oldest == all.end())
        throw error(errc::overloaded, fmt::format("{} instances run here, which is the limit", all.size()));
    auto forgotten = oldest->first;
    instances_.forget(forgotten);
}

void starts::check_rate() {
    while (!recent_.empty() && here_.self.now() - recent_.front() > here_.options.starts_window) recent_.pop_front();
    if (recent_.size() >= here_.options.max_starts)
        throw error(errc::overloaded,
                    fmt::format("{} components were started within {:g} s, which is the limit: try again soon",
                                recent_.size(), std::chrono::duration<double>(here_.options.starts_window).count()));
    recent_.push_back(here_.self.now());
}

start_response starts::refused(const error& why) const {
    auto made = refusal(why);
    if (made.outcome == start_outcome::too_many && recent_.size() >= here_.options.max_starts)
        made.retry_after = std::max(duration{}, recent_.front() + here_.options.starts_window - here_.self.now()) +
                           std::chrono::milliseconds(1);
    return made;
}

task<ended_response> starts::end(stop_request how, bool at_once) {
    auto one = table_.at(how.path);
    auto patience = std::clamp(how.grace.value_or(one->asked.terms.grace), duration{}, duration(std::chrono::hours(1)));
    instances_.carry_out(one,
                         at_once ? one->watch.kill(here_.self.now()) : one->watch.stop(here_.self.now(), patience));
    while (one->watch.state() == instance_state::stopping) co_await next_change(here_.self.on(), one);
    ended_response made;
    for (auto where = table_.process_of(*one); where && where->ending; where = table_.process_of(*one))
        co_await here_.self.sleep(std::chrono::milliseconds(10));
    made.ended = one->text();
    if (how.forget && one->watch.over() && table_.find(how.path) == one) instances_.forget(how.path);
    co_return made;
}

} // namespace ise::instantiation
