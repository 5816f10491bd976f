#include <ise/name_server/registry.hpp>

#include <ise/core/buffer.hpp>
#include <ise/transport/udp/cookie.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {
namespace {

using naming::verdict;

constexpr duration min_lease = std::chrono::milliseconds(50);
// A lease that another server keeps is not heard being renewed, so it counts as renewed once in so long. Claimants give
// up after two renewals, the first of which may be due just then: a lease in the store whose node has died ends sooner,
// also where its name server has kept it for a while, or an election in the store began it anew.
constexpr duration unheard_renewal = std::chrono::seconds(20);

std::uint64_t microseconds_of(wall_time wall) {
    auto count = std::chrono::duration_cast<std::chrono::microseconds>(wall.time_since_epoch()).count();
    return count > 0 ? static_cast<std::uint64_t>(count) : 1;
}

naming::grant refused(const std::string& path, std::string why) {
    naming::grant made;
    made.path = path;
    made.what = verdict::refused;
    made.reason = std::move(why);
    return made;
}

naming::grant not_yet(const std::string& path, duration retry_after, std::string why) {
    naming::grant made;
    made.path = path;
    made.what = verdict::wait;
    made.retry_after = retry_after;
    made.reason = std::move(why);
    return made;
}

} // namespace

registry::registry(registry_options options, std::uint64_t incarnation, time_point now, wall_time wall,
                   registry_memory memory)
    : options_(options), incarnation_(incarnation), memory_(memory),
      last_epoch_(std::min(std::max(microseconds_of(wall), memory.epochs_below), highest_epoch)),
      recovered_(saturating_add(now, options.recovery)), last_seen_(now), hash_(memory_.secret),
      schemas_(options.limits.schemas, hash_), by_path_(0, hash_), nodes_(0, hash_) {
    options_.lease = std::max(options_.lease, min_lease);
}

registry::by_name::iterator registry::find(std::string_view path) {
    auto found = by_path_.find(path);
    return found == by_path_.end() ? components_.end() : found->second;
}

// --- time ---------------------------------------------------------------------------------------------------------

time_point registry::running_time(time_point now) {
    auto gap = now - last_seen_;
    last_seen_ = std::max(last_seen_, now);
    if (gap > options_.lease / 2) stalled_ += gap; // it is called every tick(), if it runs at all
    return last_seen_ - stalled_;
}

void registry::advance(time_point now) { expire(running_time(now)); }

bool registry::recovering(time_point now) { return running_time(now) < recovered_; }

void registry::expire(time_point at) {
    while (!expiries_.empty() && expiries_.begin()->first <= at) {
        if (options_.shared) {
            auto& late = nodes_.at(expiries_.begin()->second);
            expiries_.erase(expiries_.begin());
            late.expires = time_point::max();
            expiries_.emplace(late.expires, late.who.lease_key);
            overdue_.push_back(late.who.lease_key);
            continue;
        }
        end(nodes_.find(expiries_.begin()->second), end_of_lease::ran_out, at);
    }
}

void registry::end(by_number<node>::iterator gone, end_of_lease why, time_point at) {
    auto paths = gone->second.paths; // removing changes them
    last_holder who;
    who.why = why;
    who.host_name = gone->second.who.host_name;
    who.process_id = gone->second.who.process_id;
    who.at = at;
    for (const auto& path : paths) {
        who.epoch = find(path)->second.claim.epoch;
        remember(path, who);
        remove(path);
    }
    expiries_.erase({gone->second.expires, gone->first});
    nodes_.erase(gone);
}

void registry::renew_lease(node& of, time_point at) {
    expiries_.erase({of.expires, of.who.lease_key});
    of.renewed = at;
    ++of.renewals;
    of.expires = saturating_add(at, of.lease);
    expiries_.emplace(of.expires, of.who.lease_key);
}

// --- claims -------------------------------------------------------------------------------------------------------

naming::register_response registry::enroll(const naming::register_request& request, time_point now) {
    auto at = running_time(now);
    expire(at);
    naming::register_response response;
    response.server_incarnation = incarnation_;
    auto deny_all = [&](const naming::grant& answer) {
        for (const auto& claim : request.components) {
            response.grants.push_back(answer);
            response.grants.back().path = claim.path;
        }
        return response;
    };
    if (auto why = objection_to(request.node, options_.limits)) return deny_all(refused({}, *why));
    auto known = nodes_.find(request.node.lease_key);
    if (known == nodes_.end()) {
        if (nodes_.size() >= options_.limits.max_nodes)
            return deny_all(
                not_yet({}, patience(), fmt::format("{} nodes are registered, which is max_nodes", nodes_.size())));
        known = nodes_.try_emplace(request.node.lease_key).first;
        known->second.number = ++last_lease_;
    }
    auto& from = known->second;
    from.who = request.node;
    from.lease = std::clamp(request.lease, min_lease, options_.lease);
    renew_lease(from, at);
    response.lease = from.lease;
    response.lease_number = from.number;

    auto unusable = take(request.schemas);
    for (const auto& claim : request.components) {
        response.grants.push_back(decide(from, claim, at));
        auto& last = response.grants.back();
        if (last.what == verdict::granted) last.reason = unusable;
    }
    schemas_.sweep();
    return response;
}

// A schema that is none concerns those who wrote it, not the names.
std::string registry::take(const std::vector<naming::schema_text>& schemas) {
    std::string unusable;
    for (const auto& text : schemas)
        if (auto kept = schemas_.offer(text); !kept && unusable.empty()) unusable = kept.error().message();
    return unusable;
}

// Only this server, and one that has its secret, can tell it; and it is of no use to another node.
std::uint64_t registry::proof_of(std::string_view path, std::uint64_t epoch, const node& of) const {
    buffer text(64);
    text.append(epoch);
    text.append(of.who.lease_key);
    text.append(as_bytes(path));
    return net::udp::keyed_hash(memory_.secret, text.view());
}

naming::grant registry::decide(node& from, naming::component_claim claim, time_point at) {
    auto path = claim.path;
    if (auto why = objection_to(claim, options_.limits)) return refused(path, std::move(*why));
    auto shown = claim.epoch;
    bool recovering = at < recovered_;
    bool proven = shown != 0 && claim.proof == proof_of(path, shown, from);
    bool may_be_former = proven || (shown != 0 && !memory_.of_former); // who held it before this server ran
    // Every later grant goes above it: one higher than all so far is believed, without a proof, of those only who held
    // names before, if a clock can have given it.
    bool believed = proven || (may_be_former && recovering && shown < highest_epoch);
    auto fresh = [&] {
        auto epoch = (believed ? std::max(last_epoch_, shown) : last_epoch_) + 1;
        if (first_epoch_ == 0) first_epoch_ = epoch;
        return epoch;
    };

    if (auto held = find(path); held != components_.end()) {
        auto& holder = held->second;
        auto epoch = holder.claim.epoch;
        if (holder.owner == &from)
            return accept(from, std::move(claim), claim.incarnation == holder.claim.incarnation ? epoch : fresh());
        // Of two grants of a server that ran before, the higher one is the later one, whenever its holder comes back.
        if (may_be_former && shown > epoch && !granted_here(epoch)) {
            auto* loser = holder.owner;
            auto granted = accept(from, std::move(claim), believed || shown <= last_epoch_ ? shown : fresh());
            if (granted.what == verdict::granted)
                loser->lost[path] = denied(path, verdict::superseded, find(path)->second, at);
            return granted;
        }
        return denied(path, shown != 0 ? verdict::superseded : verdict::taken, holder, at);
    }
    if (recovering && !may_be_former)
        return not_yet(path, recovered_ - at, "the name server has just started: former holders get their names first");
    auto last = last_held_.find(path);
    bool nobody_since = recovering || (proven && last != last_held_.end() && last->second.epoch == shown);
    return accept(from, std::move(claim), believed && nobody_since ? shown : fresh());
}

std::optional<std::string> registry::no_room(const node& from, const naming::component_claim& claim) const {
    const auto& limits = options_.limits;
    auto held = by_path_.find(claim.path);
    const auto* before = held == by_path_.end() ? nullptr : &held->second->second.claim;
    auto services = services_ + under_way_.services + claim.services.size() - (before ? before->services.size() : 0);
    auto claims_bytes = claims_bytes_ + under_way_.bytes + memory_of(claim) - (before ? memory_of(*before) : 0);
    auto names = from.paths.size() + from.lost.size();
    if (auto written = under_way_.by_node.find(from.who.lease_key); written != under_way_.by_node.end())
        names += written->second;
    if (auto all = components_.size() + under_way_.names; !before && all >= limits.max_components)
        return fmt::format("{} names are registered, which is max_components", all);
    if (names >= limits.max_components_per_node && !from.paths.contains(claim.path) && !from.lost.contains(claim.path))
        return fmt::format("{} names of this node are registered or were lost, which is max_components_per_node",
                           names);
    if (services > limits.max_services)
        return fmt::format("{} services are registered, max_services is {}", services_, limits.max_services);
    if (claims_bytes > limits.max_claims_bytes)
        return fmt::format("all claims would take {} bytes, max_claims_bytes is {}", claims_bytes,
                           limits.max_claims_bytes);
    return objection_to_roles(claim);
}

naming::grant registry::accept(node& from, naming::component_claim claim, std::uint64_t epoch) {
    if (auto why = no_room(from, claim)) return not_yet(claim.path, patience(), std::move(*why));
    return place(from, std::move(claim), epoch);
}

naming::grant registry::place(node& from, naming::component_claim claim, std::uint64_t epoch) {
    auto held = find(claim.path);
    bool is_new = held == components_.end();
    auto services = services_ + claim.services.size() - (is_new ? 0 : held->second.claim.services.size());
    auto claims_bytes = claims_bytes_ + memory_of(claim) - (is_new ? 0 : memory_of(held->second.claim));
    last_epoch_ = std::max(last_epoch_, epoch);
    claim.epoch = epoch;
    naming::grant granted;
    granted.path = claim.path;
    granted.epoch = epoch;
    granted.proof = proof_of(claim.path, epoch, from);
    auto path = claim.path;
    schemas_.use(claim.services);
    if (is_new) {
        held = components_.try_emplace(path).first;
        by_path_.emplace(held->first, held);
    } else {
        schemas_.release(held->second.claim.services);
        held->second.owner->paths.erase(path);
        leave_roles(held->second);
    }
    auto& entry = held->second;
    auto before = is_new ? naming::listed_name() : listed(entry);
    services_ = services;
    claims_bytes_ = claims_bytes;
    entry.claim = std::move(claim);
    entry.owner = &from;
    from.paths.insert(path);
    from.lost.erase(path);
    last_held_.erase(path);
    serve_roles(entry);
    auto after = listed(entry);
    bool same = before.epoch == after.epoch && before.incarnation == after.incarnation && before.state == after.state &&
                before.type == after.type && before.endpoints == after.endpoints &&
                before.services_provided == after.services_provided && before.roles == after.roles &&
                before.waits_for == after.waits_for;
    if (is_new || !same) note(is_new ? naming::name_change::added : naming::name_change::changed, entry);
    return granted;
}

naming::renew_response registry::renew(const naming::renew_request& request, time_point now) {
    auto at = running_time(now);
    expire(at);
    naming::renew_response response;
    response.server_incarnation = incarnation_;
    auto found = nodes_.find(request.lease_key);
    if (found == nodes_.end()) return response;
    auto& from = found->second;
    renew_lease(from, at);
    response.known = true;
    response.lease_number = from.number;
    response.lease = from.lease;
    for (const auto& [path, grant] : from.lost) response.lost.push_back(grant);
    return response;
}

void registry::withdraw(const naming::withdraw_request& request, time_point now) {
    expire(running_time(now));
    auto found = nodes_.find(request.lease_key);
    if (found == nodes_.end()) return;
    auto& from = found->second;
    for (const auto& gone : request.departures) {
        from.lost.erase(gone.path);
        auto held = find(gone.path);
        if (held != components_.end() && held->second.owner == &from &&
            held->second.claim.incarnation == gone.incarnation)
            remove(gone.path);
    }
    if (from.paths.empty() && from.lost.empty()) {
        expiries_.erase({from.expires, from.who.lease_key});
        nodes_.erase(found);
    }
}

result<naming::ended_response> registry::end(const naming::ended_request& request, time_point now) {
    auto at = running_time(now);
    expire(at);
    if (request.launch_mark.size() < naming::min_mark_bytes)
        return failure(
            errc::refused,
            fmt::format("a mark of {} bytes is not a secret of whoever started a process: it has at least {}",
                        request.launch_mark.size(), naming::min_mark_bytes));
    naming::ended_response response;
    for (auto next = nodes_.begin(); next != nodes_.end();) {
        auto one = next++;
        if (one->second.who.launch_mark != request.launch_mark) continue;
        end(one, end_of_lease::reported, at);
        ++response.nodes;
    }
    return response;
}

void registry::remove(const std::string& path) {
    auto held = find(path);
    note(naming::name_change::removed, held->second);
    schemas_.release(held->second.claim.services);
    services_ -= held->second.claim.services.size();
    claims_bytes_ -= memory_of(held->second.claim);
    leave_roles(held->second);
    held->second.owner->paths.erase(held->first);
    by_path_.erase(held->first);
    components_.erase(held);
}

std::optional<std::string> registry::objection_to_roles(const naming::component_claim& claim) const {
    for (const auto& [role, priority] : claim.roles) {
        auto known = roles_.find(role);
        if (known != roles_.end() && known->second.contains(claim.path)) continue;
        auto written = under_way_.by_role.find(role);
        auto members = (known == roles_.end() ? 0 : known->second.size()) +
                       (written == under_way_.by_role.end() ? 0 : written->second);
        if (members >= options_.limits.max_members_per_role)
            return fmt::format("{} components serve the role '{}', which is max_members_per_role", members, role);
    }
    return std::nullopt;
}

void registry::serve_roles(const component& who) {
    for (const auto& [role, priority] : who.claim.roles) {
        roles_[role].insert(who.claim.path);
        changed_roles_.insert(role);
    }
}

void registry::leave_roles(const component& who) {
    for (const auto& [role, priority] : who.claim.roles) {
        auto known = roles_.find(role);
        known->second.erase(who.claim.path);
        if (known->second.empty()) roles_.erase(known);
        changed_roles_.insert(role);
    }
}

void registry::remember(const std::string& path, last_holder who) {
    // Which one is forgotten does not matter: a holder that is not remembered gets a new epoch.
    if (last_held_.size() >= options_.limits.max_remembered) last_held_.erase(last_held_.begin());
    last_held_[path] = std::move(who);
}

naming::holder registry::holder_of(const component& held, time_point at) const {
    naming::holder who;
    who.epoch = held.claim.epoch;
    who.incarnation = held.claim.incarnation;
    who.host_name = held.owner->who.host_name;
    who.process_id = held.owner->who.process_id;
    if (!held.claim.endpoints.empty()) who.endpoint = held.claim.endpoints.front();
    who.lease_age = at - held.owner->renewed;
    who.renewals = held.owner->renewals;
    if (kept_elsewhere(*held.owner))
        who.renewals +=
            static_cast<std::uint64_t>((at - std::max(held.owner->renewed, heard_since_)) / unheard_renewal);
    return who;
}

naming::grant registry::denied(const std::string& path, verdict what, const component& held, time_point at) const {
    naming::grant made;
    made.path = path;
    made.what = what;
    made.held_by.push_back(holder_of(held, at));
    const auto& who = made.held_by.back();
    auto age = std::chrono::duration_cast<std::chrono::milliseconds>(who.lease_age).count();
    made.reason = fmt::format(
        "'{}' is held by process {} on {}{} under epoch {}, whose lease {}: end it, or choose another path", path,
        who.process_id, who.host_name, who.endpoint.empty() ? "" : " at " + who.endpoint, who.epoch,
        kept_elsewhere(*held.owner) ? "another name server keeps" : fmt::format("was renewed {} ms ago", age));
    return made;
}

void registry::note(naming::name_change what, const component& held) {
    naming::name_event event;
    event.what = what;
    event.name = listed(held);
    changes_.push_back(std::move(event));
}

// --- of a store that is shared ------------------------------------------------------------------------------------

void registry::know_node(const naming::node_identity& who, duration lease, bool kept_here, time_point now) {
    auto at = running_time(now);
    auto [known, is_new] = nodes_.try_emplace(who.lease_key);
    auto& one = known->second;
    if (is_new) one.number = ++last_lease_;
    one.who = who;
    one.lease = std::clamp(lease, min_lease, options_.lease);
    if (kept_here || is_new) renew_lease(one, at);
    if (kept_here) return;
    expiries_.erase({one.expires, who.lease_key});
    one.expires = time_point::max();
    expiries_.emplace(one.expires, who.lease_key);
}

void registry::extend(std::uint64_t lease_key, duration by, time_point now) {
    auto at = running_time(now);
    auto known = nodes_.find(lease_key);
    if (known == nodes_.end()) return;
    auto& one = known->second;
    expiries_.erase({one.expires, lease_key});
    // One that `expire` has found overdue has no end until then.
    const bool overdue = one.expires == time_point::max();
    one.expires = overdue ? saturating_add(at, by) : std::max(one.expires, saturating_add(at, by));
    expiries_.emplace(one.expires, lease_key);
}

duration registry::silent_for(std::uint64_t lease_key, time_point now) {
    auto at = running_time(now);
    auto known = nodes_.find(lease_key);
    return known == nodes_.end() ? duration::max() : at - known->second.renewed;
}

void registry::end_node(std::uint64_t lease_key, time_point now) {
    auto at = running_time(now);
    if (auto known = nodes_.find(lease_key); known != nodes_.end()) end(known, end_of_lease::ran_out, at);
}

void registry::hold(std::uint64_t lease_key, naming::component_claim claim, time_point now) {
    auto at = running_time(now);
    auto known = nodes_.find(lease_key);
    if (known == nodes_.end()) return;
    node* loser = nullptr;
    auto path = claim.path;
    if (auto held = find(path); held != components_.end() && held->second.owner != &known->second)
        loser = held->second.owner;
    auto epoch = claim.epoch;
    place(known->second, std::move(claim), epoch); // the limits were kept where it was granted
    if (loser) loser->lost[path] = denied(path, verdict::superseded, find(path)->second, at);
}

void registry::drop(std::string_view path, time_point now) {
    (void)running_time(now);
    if (find(path) != components_.end()) remove(std::string(path));
}

void registry::offer(const std::vector<naming::schema_text>& schemas, std::vector<naming::grant>& grants) {
    auto unusable = take(schemas);
    for (auto& one : grants)
        if (one.what == verdict::granted) one.reason = unusable;
    schemas_.sweep();
}

std::vector<std::uint64_t> registry::take_overdue() { return std::exchange(overdue_, {}); }

std::vector<std::uint64_t> registry::marked(const std::string& launch_mark) const {
    std::vector<std::uint64_t> found;
    for (const auto& [key, one] : nodes_)
        if (one.who.launch_mark == launch_mark) found.push_back(key);
    return found;
}

std::optional<naming::grant> registry::held_by_other(const naming::component_claim& claim, std::uint64_t lease_key,
                                                     time_point now) {
    auto at = running_time(now);
    auto held = find(claim.path);
    if (held == components_.end() || held->second.owner->who.lease_key == lease_key) return std::nullopt;
    return denied(claim.path, claim.epoch != 0 ? verdict::superseded : verdict::taken, held->second, at);
}

std::optional<std::string> registry::no_room(const naming::component_claim& claim, std::uint64_t lease_key) const {
    auto known = nodes_.find(lease_key);
    return known == nodes_.end() ? std::nullopt : no_room(known->second, claim);
}

void registry::claims_under_way::add(const naming::component_claim& claim) {
    auto held = in_.by_path_.find(claim.path);
    const auto* before = held == in_.by_path_.end() ? nullptr : &held->second->second.claim;
    auto growth = [](std::size_t now, std::size_t then) { return now - std::min(now, then); };
    auto& made = all_.emplace_back();
    made.claim = &claim;
    made.names = before ? 0 : 1;
    made.services = growth(claim.services.size(), before ? before->services.size() : 0);
    made.bytes = growth(memory_of(claim), before ? memory_of(*before) : 0);
    auto& all = in_.under_way_;
    all.names += made.names;
    all.services += made.services;
    all.bytes += made.bytes;
    if (made.names > 0) ++all.by_node[lease_key_];
    for (const auto& [role, priority] : claim.roles) ++all.by_role[role];
}

registry::claims_under_way::~claims_under_way() {
    auto& all = in_.under_way_;
    auto less = [](auto& numbers, const auto& key) {
        auto found = numbers.find(key);
        if (--found->second == 0) numbers.erase(found);
    };
    for (const auto& one : all_) {
        all.names -= one.names;
        all.services -= one.services;
        all.bytes -= one.bytes;
        if (one.names > 0) less(all.by_node, lease_key_);
        for (const auto& [role, priority] : one.claim->roles) less(all.by_role, role);
    }
}

std::vector<naming::name_event> registry::take_changes() { return std::exchange(changes_, {}); }
std::set<std::string> registry::take_changed_roles() { return std::exchange(changed_roles_, {}); }

} // namespace ise
