#include <ise/instantiation/refusal.hpp>

#include <ise/instantiation/own_user.hpp>
#include <ise/instantiation/words.hpp>
#include <ise/naming/services.hpp>

#include <fmt/format.h>

namespace ise::instantiation {

using namespace std::chrono_literals;

std::string objection_to_own(const start_request& request, const launch_rules& rules) {
    if (request.identity.empty() && request.user.empty()) return {};
    if (!request.process.empty())
        return "identity and user belong to a whole process: a component that shares one cannot have its own";
    if (!request.identity.empty() && !is_word(request.identity))
        return fmt::format("'{}' is no name of an identity: it is that of a folder, of lower-case letters, digits, - "
                           "and _",
                           shown(request.identity));
    if (!request.identity.empty() && rules.identities_folder.empty())
        return fmt::format("this instantiation server has no certificates for the identity '{}': start it with "
                           "--identities FOLDER",
                           request.identity);
    return request.user.empty() ? std::string() : objection_to_user(request.user, rules);
}

void check_wishes(const start_request& request, const launch_rules& rules) {
    const auto& terms = request.terms;
    auto refuse = [](std::string_view what) { throw error(errc::invalid_argument, fmt::format("{}", what)); };
    auto within = [](duration value, duration least, duration most) { return value >= least && value <= most; };
    if (terms.policy > restart_policy::always) refuse("the restart policy is never, on_failure or always");
    if (!within(terms.first_pause, 10ms, 1h) || !within(terms.max_pause, terms.first_pause, 1h))
        refuse("pauses before a restart are from 10 ms to 1 h, the longest not below the first");
    if (terms.limit > 1000) refuse("at most 1000 restarts within a window are allowed");
    if (!within(terms.window, 1s, 24h)) refuse("the window of restarts is from 1 s to 24 h");
    if (!within(terms.grace, 0s, 1h)) refuse("the grace of a stop is at most 1 h");
    if (!within(terms.ready_within, 100ms, 1h)) refuse("the time to become ready is from 100 ms to 1 h");
    if (!within(terms.probe_every, 100ms, 1h)) refuse("a probe is sent every 100 ms to every hour");
    if (terms.probe_failures < 1 || terms.probe_failures > 1000)
        refuse("a probe may fail 1 to 1000 times on end before the component is started again");
    const auto& deployment = request.deployment;
    if (!deployment.empty() && (deployment.size() > naming::max_path || !naming::is_path(deployment)))
        refuse(fmt::format("'{}' is not the name of a deployment: letters, digits, -, _ and . make one, of at most {} "
                           "bytes",
                           shown(deployment), naming::max_path));
    check(request.limits).value();
    if (!request.process.empty() && !(request.limits == resource_limits()))
        refuse("limits belong to a whole process: a component that shares one cannot be given its own");
    auto objection = objection_to_own(request, rules);
    if (!objection.empty()) refuse(objection);
}

start_response refusal(const error& why) {
    start_response made;
    made.why = why.what();
    switch (why.code()) {
        case errc::invalid_argument: made.outcome = start_outcome::bad_argument; break;
        case errc::no_such_name: made.outcome = start_outcome::no_such_type; break;
        case errc::name_taken: made.outcome = start_outcome::name_taken; break;
        case errc::address_in_use: made.outcome = start_outcome::address_in_use; break;
        case errc::overloaded: made.outcome = start_outcome::too_many; break;
        case errc::name_server_lost: made.outcome = start_outcome::name_server_lost; break;
        default: made.outcome = start_outcome::not_launched; break;
    }
    return made;
}

} // namespace ise::instantiation
