#include <ise/instantiation/refusal.hpp>
#include <ise/instantiation/start_checks.hpp>

#include <ise/service/service_host.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::instantiation {
namespace {

constexpr std::size_t max_checks = 256;
constexpr std::size_t max_compared = 20; // of one instance within the window: comparing guesses secrets
constexpr duration compared_window = std::chrono::seconds(10);

} // namespace

void check_endpoints(component& self, const std::vector<endpoint>& wanted) {
    for (const auto& at : wanted) {
        auto listening = at.kind->listen(self.on(), at, self.services().peers().credentials());
        if (!listening) throw error(listening.error());
    }
}

task<checks_response> start_checks::check(checks_request request) {
    if (request.wanted.size() > max_checks)
        throw error(errc::overloaded,
                    fmt::format("{} components are to be checked, {} are allowed", request.wanted.size(), max_checks));
    co_await types_.refresh();
    checks_response made;
    std::vector<endpoint> wanted;
    for (auto& one : request.wanted) {
        checked_start result;
        bool name_server_lost = !made.checked.empty() && made.checked.back().outcome == start_outcome::name_server_lost;
        if (name_server_lost) { // it is not waited for again and again
            result = made.checked.back();
        } else {
            try {
                result = co_await check_one(std::move(one), wanted);
            } catch (const error& why) {
                auto refused = refusal(why);
                result.outcome = refused.outcome;
                result.why = std::move(refused.why);
            }
        }
        made.checked.push_back(std::move(result));
    }
    co_return made;
}

task<checked_start> start_checks::check_one(start_request request, std::vector<endpoint>& wanted) {
    checked_start made;
    check_wishes(request, here_.options.rules);
    auto copy = request;
    auto planned = co_await types_.plan(std::move(copy));
    shared_.check(request.process, planned.program);
    for (const auto& at : planned.listen) {
        bool any_port = at.has_port() && at.port == 0;
        if (!any_port && std::ranges::find(wanted, at) != wanted.end())
            throw error(errc::address_in_use,
                        fmt::format("another component of the file listens on {} too", at.text()));
        wanted.push_back(at);
    }
    auto here = table_.find(planned.path);
    bool runs = here && !here->watch.over();
    if (runs) made.other_environment = compare_environment(here, request);
    else co_await names_.check_free(planned.path);
    // What instances of the same deployment listen on is free when they have been changed or stopped.
    auto is_theirs = [&](const endpoint& at) {
        return std::ranges::any_of(table_.instances(), [&](const auto& one) {
            bool counts = one.first == planned.path ||
                          (!request.deployment.empty() && one.second->asked.deployment == request.deployment);
            return counts && !one.second->watch.over() &&
                   std::ranges::find(one.second->plan.listen, at) != one.second->plan.listen.end();
        });
    };
    std::erase_if(planned.listen, is_theirs);
    check_endpoints(here_.self, planned.listen);
    co_return made;
}

bool start_checks::compare_environment(const instance_ptr& one, const start_request& wanted) {
    auto& when = one->compared;
    while (!when.empty() && here_.self.now() - when.front() > compared_window) when.pop_front();
    if (when.size() >= max_compared)
        throw error(errc::overloaded,
                    fmt::format("the environment variables of '{}' were compared {} times within {:g} s, which is the "
                                "limit: try again soon",
                                one->plan.path, when.size(), std::chrono::duration<double>(compared_window).count()));
    when.push_back(here_.self.now());
    return one->other_environment(wanted);
}

} // namespace ise::instantiation
