#include <ise/name_server/name_server.hpp>

#include <ise/access/guard.hpp>
#include <ise/name_server/shared_names.hpp>
#include <ise/service/service_host.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

namespace ise {
namespace {

// The bound that is kept lies this far above the epochs that were granted, so that the disk is seldom asked.
constexpr std::uint64_t epochs_ahead = std::uint64_t{1} << 20;

// Refuses a text that is longer than any path, before it is stored or repeated in an answer.
std::optional<failure> too_long(std::string_view what, const std::string& text, const registry_limits& limits) {
    if (text.size() <= limits.max_path_bytes) return std::nullopt;
    return failure(errc::too_large,
                   fmt::format("a {} of {} bytes, max_path_bytes is {}", what, text.size(), limits.max_path_bytes));
}

} // namespace

name_server::name_server(name_server_options options) : options_(std::move(options)) {}
name_server::~name_server() = default;

// Throws where what the last one has kept cannot be used: without it, names could be stolen.
void name_server::recall() {
    if (options_.memory)
        if (auto before = options_.memory->load().value()) memory_ = *before;
    if (!memory_.of_former) memory_.secret = {env().random(), env().random()};
}

// No epoch is told that is not below the bound.
void name_server::keep_ahead() {
    if (!options_.memory || registry_->last_epoch() + epochs_ahead / 2 < memory_.epochs_below) return;
    memory_.epochs_below = registry_->last_epoch() + epochs_ahead;
    auto kept = options_.memory->keep(memory_);
    if (!kept)
        log().error(
            fmt::format("the next name server will not know the grants of this one: {}", kept.error().message()));
}

// What changes names: of this name server alone, decided at once.
void name_server::provide_own_names() {
    provide(naming::enroll, [this](naming::register_request request, const call_context& by) {
        auto response = enroll(std::move(request), by.verified);
        keep_ahead();
        changed();
        return response;
    });
    provide(naming::renew, [this](naming::renew_request request) {
        auto response = registry_->renew(request, now());
        changed();
        return response;
    });
    provide(naming::withdraw, [this](naming::withdraw_request request) {
        registry_->withdraw(request, now());
        changed();
        return naming::withdraw_response();
    });
    provide(naming::ended, [this](naming::ended_request request) {
        auto response = registry_->end(request, now());
        changed();
        return response;
    });
}

// The same with a store: decided there.
void name_server::provide_shared_names() {
    store_ = options_.store(env(), on());
    shared_ = std::make_unique<shared_names>(on(), env(), services().scope(), services().log(), *store_, *registry_,
                                             services().self().incarnation, [this] { changed(); });
    provide(naming::enroll, [this](naming::register_request request, const call_context& by) {
        return enroll_shared(std::move(request), by.verified);
    });
    provide(naming::renew, [this](naming::renew_request request) { return shared_->renew(request); });
    provide(naming::withdraw,
            [this](naming::withdraw_request request) { return shared_->withdraw(std::move(request)); });
    provide(naming::ended, [this](naming::ended_request request) { return shared_->end(std::move(request)); });
}

task<> name_server::run() {
    if (!options_.store) recall();
    else memory_.secret = {env().random(), env().random()};
    registry_options options;
    // The store forgets a node that is silent here before its lease there ends.
    if (options_.store) options_.lease = std::min(options_.lease, shared_names::store_lease - std::chrono::seconds(3));
    options.lease = options_.lease;
    options.recovery = options_.fresh ? duration{} : options_.lease;
    options.limits = options_.limits;
    options.shared = static_cast<bool>(options_.store);
    registry_ = std::make_unique<registry>(options, services().self().incarnation, now(), wall(), memory_);
    if (!options_.store) keep_ahead();

    if (options_.store) provide_shared_names();
    else provide_own_names();
    provide(naming::resolve, [this](naming::resolve_request request) -> result<naming::resolve_response> {
        if (auto why = too_long("path", request.path, options_.limits)) return std::move(*why);
        return registry_->resolve(request.path, now());
    });
    provide(naming::list, [this](naming::list_request request) {
        auto response = registry_->list(request, now());
        if (shared_) response.trouble = shared_->report();
        return response;
    });
    provide(naming::lost, [this](naming::lost_request request) { return registry_->lost(request.prefix, now()); });
    provide(naming::describe, [this](naming::describe_request request) -> result<naming::describe_response> {
        if (auto why = too_long("path", request.path, options_.limits)) return std::move(*why);
        return registry_->describe(request.path, now());
    });

    serve_options many;
    many.concurrent = 20'000; // who waits for a name costs a small coroutine
    many.waiting = 1024;
    provide(
        naming::wait_for,
        [this](naming::await_request request, const call_context& call) {
            auto longest = std::clamp(request.wait, duration{}, naming::max_wait);
            return wait_for(std::move(request.path), request.other_than,
                            std::min(call.deadline, saturating_add(now(), longest)));
        },
        many);

    publication_callbacks<subscription<naming::name_events, naming::watch_request>> callbacks;
    callbacks.on_subscribe = [this](const naming::watch_request& request,
                                    const subscriber_info& who) -> result<nothing> {
        if (auto why = too_long("prefix", request.prefix, options_.limits)) return std::move(*why);
        watcher made;
        made.prefix = request.prefix;
        while (made.prefix.ends_with('/')) made.prefix.pop_back();
        watchers_[who.number] = std::move(made);
        on().later([this, number = who.number] { welcome(number); }); // behind the answer
        return nothing();
    };
    callbacks.on_unsubscribe = [this](const nothing&, const subscriber_info& who) {
        watchers_.erase(who.number);
        return nothing();
    };
    events_ = publish(naming::watch, std::move(callbacks));
    provide_role_changes();

    tick_ = std::make_unique<timer>(on(), [this] { tick(); });
    tick();
    co_return;
}

// What the access policy does not let the claimant have is not claimed: a path is refused, a role is left out.
name_server::judged name_server::judge(naming::register_request& request, const verified_peer* by) {
    judged all;
    auto* policy = services().access();
    if (!policy || !by || by->same_process) return all;
    auto& answers = all.answers;
    std::vector<naming::component_claim> allowed;
    for (auto& claim : request.components) {
        auto& last = answers.emplace_back();
        last.path = claim.path;
        if (auto why = objection_to(claim, options_.limits)) { // before anything is kept, compared or written
            last.refused = true;
            last.against = std::move(*why);
            continue;
        }
        auto& known = claimed_[claim.path];
        const bool news = claim.epoch == 0 || known != claim.roles;
        access::request what;
        const std::string path[] = {claim.path};
        what.what = access::action::name;
        what.targets = path;
        if (auto denied = policy->objection(by, what, services().self().path, news)) {
            last.refused = true;
            last.against = denied->message();
            claimed_.erase(claim.path);
            continue;
        }
        known = claim.roles;
        std::erase_if(claim.roles, [&](const auto& role) {
            const std::string named[] = {role.first};
            what.what = access::action::role;
            what.targets = named;
            what.priority = role.second;
            auto denied = policy->objection(by, what, services().self().path, news);
            if (denied) last.against += (last.against.empty() ? "" : "; ") + denied->message();
            return denied.has_value();
        });
        allowed.push_back(std::move(claim));
    }
    if (claimed_.size() > 2 * options_.limits.max_nodes) claimed_.clear(); // told once more, if need be
    all.all_refused = allowed.empty(); // also who claims nothing: a node without a name would take a place
    request.components = std::move(allowed);
    return all;
}

naming::register_response name_server::enroll(naming::register_request request, const verified_peer* by) {
    auto all = judge(request, by);
    naming::register_response response;
    if (!all.all_refused) response = registry_->enroll(request, now());
    else {
        response.server_incarnation = services().self().incarnation;
        naming::renew_request held; // what was granted before stays
        held.lease_key = request.node.lease_key;
        if (auto known = registry_->renew(held, now()); known.known) {
            response.lease = known.lease;
            response.lease_number = known.lease_number;
        }
    }
    merge(all, response);
    return response;
}

task<naming::register_response> name_server::enroll_shared(naming::register_request request, const verified_peer* by) {
    auto all = judge(request, by);
    naming::register_response response;
    if (!all.all_refused) {
        response = co_await shared_->enroll(std::move(request));
    } else {
        naming::renew_request held; // what was granted before stays
        held.lease_key = request.node.lease_key;
        auto known = co_await shared_->renew(held);
        response.server_incarnation = known.server_incarnation;
        response.lease = known.lease;
        response.lease_number = known.lease_number;
    }
    changed();
    merge(all, response);
    co_return response;
}

void name_server::merge(const judged& all, naming::register_response& response) {
    if (all.answers.empty()) return;
    std::vector<naming::grant> grants;
    auto next = response.grants.begin();
    for (const auto& one : all.answers) {
        if (!one.refused && next != response.grants.end()) {
            if (next->what == naming::verdict::granted && !one.against.empty()) next->reason = one.against;
            grants.push_back(std::move(*next++));
            continue;
        }
        naming::grant refused;
        refused.path = one.path;
        refused.what = naming::verdict::refused;
        refused.reason = one.against;
        grants.push_back(std::move(refused));
    }
    response.grants = std::move(grants);
}

void name_server::tick() {
    registry_->advance(now());
    if (shared_) shared_->tick();
    changed();
    if (recovering_ && !registry_->recovering(now())) { // from now on what is told is all there is
        recovering_ = false;
        std::set<std::string> roles;
        for (const auto& [number, role] : role_watchers_) roles.insert(role);
        for (const auto& role : roles) tell_watchers(role);
    }
    tick_->arm(saturating_add(now(), registry_->tick()));
}

void name_server::changed() {
    auto roles = registry_->take_changed_roles();
    for (const auto& role : roles) {
        tell_watchers(role);
        wake_waiting(role);
    }
    auto events = registry_->take_changes();
    if (events.empty()) return;
    for (const auto& event : events)
        if (event.what != naming::name_change::removed) wake_waiting(event.name.path);
    // A packet for each prefix that somebody watches.
    std::set<std::string> prefixes;
    for (const auto& [number, entry] : watchers_)
        if (entry.has_snapshot) prefixes.insert(entry.prefix);
    for (const auto& prefix : prefixes) {
        naming::name_events packet;
        for (const auto& event : events)
            if (naming::lies_below(event.name.path, prefix)) packet.events.push_back(event);
        if (packet.events.empty()) continue;
        events_.publish_if(packet, [&](const subscriber_info& who) {
            auto found = watchers_.find(who.number);
            return found != watchers_.end() && found->second.has_snapshot && found->second.prefix == prefix;
        });
    }
}

void name_server::wake_waiting(const std::string& path) {
    auto [first, last] = waiting_.equal_range(path);
    for (; first != last; ++first) first->second->resume();
}

void name_server::provide_role_changes() {
    publication_callbacks<subscription<naming::role_members, naming::role_request>> callbacks;
    callbacks.on_subscribe = [this](const naming::role_request& request,
                                    const subscriber_info& who) -> result<nothing> {
        if (auto why = too_long("role", request.role, options_.limits)) return std::move(*why);
        role_watchers_[who.number] = request.role;
        on().later([this, number = who.number] { // behind the answer
            auto found = role_watchers_.find(number);
            if (found != role_watchers_.end())
                tell_members(found->second, [number](const subscriber_info& one) { return one.number == number; });
        });
        return nothing();
    };
    callbacks.on_unsubscribe = [this](const nothing&, const subscriber_info& who) {
        role_watchers_.erase(who.number);
        return nothing();
    };
    role_changes_ = publish(naming::role_changes, std::move(callbacks));
}

void name_server::tell_watchers(const std::string& role) {
    bool watched = std::ranges::any_of(role_watchers_, [&](const auto& entry) { return entry.second == role; });
    if (!watched) return;
    tell_members(role, [&](const subscriber_info& who) {
        auto found = role_watchers_.find(who.number);
        return found != role_watchers_.end() && found->second == role;
    });
}

void name_server::tell_members(const std::string& role, const std::function<bool(const subscriber_info&)>& whom) {
    auto packet = registry_->members_of(role, now());
    role_changes_.publish_if(packet, whom);
}

void name_server::welcome(std::uint64_t number) {
    auto found = watchers_.find(number);
    if (found == watchers_.end()) return;
    changed(); // nothing that the snapshot holds is told again
    found->second.has_snapshot = true;
    naming::name_events packet;
    packet.snapshot = true;
    packet.events = registry_->snapshot(found->second.prefix);
    events_.publish_if(packet, [number](const subscriber_info& who) { return who.number == number; });
}

task<naming::await_response> name_server::wait_for(std::string path, std::uint64_t other_than, time_point until) {
    if (auto why = too_long("path", path, options_.limits)) throw error(errc::refused, why->message());
    waiter<> present(on());
    timer over(on(), [&present] { present.resume(); });
    over.arm(until);
    for (;;) {
        naming::await_response response;
        auto found = registry_->resolve(path, now());
        if (found && (other_than == 0 || found->incarnation != other_than)) response.found = std::move(*found);
        response.certain = !registry_->recovering(now());
        if (response.found || now() >= until) co_return response;
        struct listed { // whichever way this coroutine ends
            std::multimap<std::string, waiter<>*>& all;
            std::multimap<std::string, waiter<>*>::iterator which;
            ~listed() { all.erase(which); }
        } guard{waiting_, waiting_.emplace(path, &present)};
        co_await present.wait();
    }
}

} // namespace ise
