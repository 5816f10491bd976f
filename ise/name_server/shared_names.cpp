#include <ise/name_server/shared_names.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/listed_waiter.hpp>
#include <ise/core/sleep.hpp>
#include <ise/packet/json.hpp>
#include <ise/service/back_off.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace ise {
namespace {

using naming::verdict;

constexpr std::string_view node_prefix = "node/", name_prefix = "name/", offset_key = "offset", pulse_key = "pulse";
constexpr duration tend_period = std::chrono::milliseconds(500);
// A store that takes longer may delay a node's renewals by as much.
constexpr duration prompt = std::chrono::milliseconds(500);
// Each lease is renewed four times in its length, and each renewal may take half of it: the store gets the next one
// though the last one is not answered.
constexpr duration keep_period = shared_names::store_lease / 4, keep_patience = shared_names::store_lease / 2;
// The lease of a node that asks for nothing is kept for so long: one that is alive and refused here tries all name
// servers in that time, and one that has died goes from the store before others take it for alive (registry.cpp).
constexpr duration keep_silent = std::chrono::seconds(8);
// Renewals under way at once: so many, and one more every `keep_pace` while the store has not answered them.
constexpr std::size_t few_keeps = 8, max_keeps = 512;
constexpr duration keep_pace = std::chrono::milliseconds(5);
// Transactions under way at once; what comes meanwhile goes together with the next one. More bytes than these are not
// put together, since etcd takes 1.5 MiB in one request.
constexpr std::size_t max_writers = 4, max_group_bytes = 512 * 1024;
// A majority was heard so lately that nothing is wrong.
constexpr duration fresh = std::chrono::seconds(3);
// Components whose claims were refused ask again within that time.
constexpr duration refusal_counts = std::chrono::seconds(10);
// A watch that was silent for so long must report a key that is written for that: one that has gone mute, as over a
// connection that a router has forgotten, looks like one of names that do not change. All servers see the same key, so
// that one of them writes it.
constexpr duration pulse_period = std::chrono::seconds(10);
constexpr duration catch_up_time = std::chrono::milliseconds(1500);

struct stored_node { // fields are only ever appended
    naming::node_identity who;
    duration lease{};
    std::uint64_t store_lease = 0;
    std::uint64_t server = 0;
};
struct stored_claim { // the same
    std::uint64_t lease_key = 0;
    std::uint64_t store_lease = 0;
    naming::component_claim claim;
};

std::string key_of_node(std::uint64_t lease_key) { return fmt::format("{}{:016x}", node_prefix, lease_key); }
std::string key_of_name(std::string_view path) { return fmt::format("{}{}", name_prefix, path); }

naming::grant answer_of(const std::string& path, verdict what, std::string why) {
    naming::grant made;
    made.path = path;
    made.what = what;
    made.reason = std::move(why);
    return made;
}

} // namespace

shared_names::shared_names(loop& on, environment& env, task_scope& scope, const logger& to, name_store& store,
                           registry& names, std::uint64_t incarnation, std::function<void()> on_change)
    : on_(on), env_(env), scope_(scope), log_(to), store_(store), names_(names), incarnation_(incarnation),
      on_change_(std::move(on_change)), started_(on.now()), nodes_(0, names.hash()), news_at_(started_) {
    names_.complete(false);
    scope_.spawn("watch of the store", watch(*this));
    scope_.spawn("state of the store", tend(*this));
    scope_.spawn("leases in the store", keep_leases(*this));
    scope_.spawn("pulse of the watch", pulse(*this));
}

std::string shared_names::trouble() const {
    if (read_ && on_.now() - heard_at_ < fresh) return {};
    return fmt::format("the store of the name server has no majority: {}; names are unconfirmed, and none is granted",
                       obstacle_);
}

std::string shared_names::report() const {
    auto why = trouble();
    if (why.empty() && unwritable_ && on_.now() - unwritable_->first < refusal_counts)
        why = fmt::format("the store of the name server refuses to write: {}; granted names stay, and none is granted",
                          unwritable_->second);
    return why;
}

// A store without space answers and renews, so it is not away.
void shared_names::give_up(const failure& why) {
    obstacle_ = why.message();
    if (why.code() == errc::refused) unwritable_.emplace(on_.now(), why.message());
    throw error(errc::refused, fmt::format("the store does not answer: {}", why.message()));
}

// --- what the store has -------------------------------------------------------------------------------------------

task<> shared_names::watch(shared_names& self) {
    back_off pause(self.env_, std::chrono::milliseconds(50), std::chrono::seconds(1));
    while (!self.scope_.stopping()) {
        if (!self.read_) {
            auto read = co_await self.read_all();
            if (!read) {
                self.obstacle_ = read.error().message();
                co_await sleep_for(self.on_, pause.next());
                continue;
            }
        }
        auto began = self.on_.now();
        auto why = co_await self.store_.follow(self.revision_,
                                               [&self](const std::vector<store_change>& changes,
                                                       std::uint64_t revision) { self.apply(changes, revision); });
        if (why.code() == errc::superseded) self.read_ = false; // some changes are not known any more
        self.log_.debug("the watch of the store has ended", {{"cause", why.message()}});
        if (self.on_.now() - began > std::chrono::seconds(5)) pause.reset();
        co_await sleep_for(self.on_, pause.next());
    }
}

task<result<void>> shared_names::read_all() {
    auto all = co_await store_.read();
    if (!all) co_return all.error();
    auto is_offset = [](const store_entry& one) { return one.key == offset_key; };
    auto offset = std::ranges::find_if(all->entries, is_offset);
    if (offset == all->entries.end()) {
        auto wall = std::chrono::duration_cast<std::chrono::microseconds>(env_.wall().time_since_epoch()).count();
        store_step first;
        first.key = offset_key;
        first.value = fmt::format("{}", std::max<std::int64_t>(wall, 1));
        std::vector<store_step> steps(1, first);
        auto written = co_await store_.write(std::move(steps));
        if (!written) co_return written.error();
        all = co_await store_.read(); // perhaps another server was first
        if (!all) co_return all.error();
        offset = std::ranges::find_if(all->entries, is_offset);
        if (offset == all->entries.end()) co_return failure(errc::malformed, "the store lost the offset of epochs");
    }
    if (all->revision < revision_) begin_anew();
    try {
        offset_ = std::stoull(offset->value);
    } catch (const std::exception&) {
        co_return failure(errc::malformed, fmt::format("'{}' in the store is no offset of epochs", offset->value));
    }
    std::set<std::string, std::less<>> there;
    for (const auto& one : all->entries) there.insert(one.key);
    std::vector<store_change> changes;
    auto note_gone = [&](std::string key) {
        if (there.contains(key)) return;
        store_change gone;
        gone.gone = true;
        gone.entry.key = std::move(key);
        changes.push_back(std::move(gone));
    };
    for (const auto& [path, one] : known_) note_gone(key_of_name(path));
    for (const auto& [key, one] : nodes_) note_gone(key_of_node(key));
    // Nodes first: names refer to them.
    std::ranges::stable_partition(all->entries, [](const auto& one) { return one.key.starts_with(node_prefix); });
    for (auto& one : all->entries) {
        store_change made;
        made.entry = std::move(one);
        changes.push_back(std::move(made));
    }
    read_ = true;
    heard();
    names_.complete(true);
    apply(changes, all->revision);
    co_return result<void>();
}

void shared_names::begin_anew() {
    log_.warning("the store was restored from a backup: all names are read anew",
                 {{"last revision", std::to_string(revision_)}});
    revision_ = pulse_ = 0;
    for (auto& [path, one] : known_) one.changed = 0;
    for (auto& [key, one] : nodes_) {
        one.changed = 0;
        one.confirmed.reset();
        one.tried.reset();
    }
}

void shared_names::apply(const std::vector<store_change>& changes, std::uint64_t revision) {
    for (const auto& one : changes) apply(one);
    revision_ = std::max(revision_, revision);
    news_at_ = on_.now(); // not `heard()`: a watch may report while requests are not answered
    on_change_();
    for (auto* one : catching_up_) one->resume();
}

void shared_names::apply(const store_change& change) {
    std::string_view key = change.entry.key;
    if (key == pulse_key) pulse_ = change.gone ? 0 : change.entry.changed;
    try {
        if (key.starts_with(node_prefix)) {
            if (change.gone) lose_node(std::stoull(std::string(key.substr(node_prefix.size())), nullptr, 16));
            else take_node(change.entry);
        } else if (key.starts_with(name_prefix)) {
            if (!change.gone) {
                take_name(change.entry);
            } else if (auto found = known_.find(key.substr(name_prefix.size())); found != known_.end()) {
                names_.drop(found->first, on_.now());
                known_.erase(found);
            }
        }
    } catch (const std::exception& unfit) {
        log_.error("an entry of the store is not readable",
                   {{"key", std::string(key)}, {"cause", std::string(unfit.what())}});
    }
}

void shared_names::take_node(const store_entry& entry) {
    auto read = from_json<stored_node>(entry.value);
    auto& one = nodes_[read.who.lease_key];
    if (one.changed >= entry.changed) return;
    if (one.what.store_lease != read.store_lease || read.server != incarnation_) {
        one.confirmed.reset();
        one.tried.reset();
    }
    const bool taken_over = read.server == incarnation_ && one.what.server != incarnation_;
    one.changed = entry.changed;
    one.what.who = read.who;
    one.what.lease = read.lease;
    one.what.store_lease = read.store_lease;
    one.what.server = read.server;
    names_.know_node(read.who, read.lease, read.server == incarnation_, on_.now());
    // Until it renews here it may be at a name server that does not know yet, because it has given this one up.
    if (taken_over) names_.extend(read.who.lease_key, store_lease, on_.now());
}

void shared_names::lose_node(std::uint64_t lease_key) {
    if (nodes_.erase(lease_key) == 0) return;
    // Names that it has written under a later lease come with their own changes.
    for (auto one = known_.begin(); one != known_.end();)
        one = one->second.lease_key == lease_key ? known_.erase(one) : std::next(one);
    names_.end_node(lease_key, on_.now());
}

void shared_names::take_name(const store_entry& entry) {
    auto read = from_json<stored_claim>(entry.value);
    auto node = nodes_.find(read.lease_key);
    if (node == nodes_.end() || node->second.what.store_lease != read.store_lease) return; // it goes with its lease
    auto& one = known_[read.claim.path];
    if (one.changed >= entry.changed) return;
    one.value = entry.value;
    one.lease_key = read.lease_key;
    one.store_lease = read.store_lease;
    one.created = entry.created;
    one.changed = entry.changed;
    read.claim.epoch = offset_ + entry.created;
    names_.hold(read.lease_key, std::move(read.claim), on_.now());
}

// --- what is written ----------------------------------------------------------------------------------------------

task<std::vector<store_outcome>> shared_names::write(std::vector<store_step> steps) {
    std::vector<store_outcome> all;
    std::uint64_t newest = 0;
    for (std::size_t begin = 0; begin < steps.size(); begin += name_store::max_steps) {
        auto end = std::min(begin + name_store::max_steps, steps.size());
        std::vector<store_step> some(std::make_move_iterator(steps.begin() + static_cast<std::ptrdiff_t>(begin)),
                                     std::make_move_iterator(steps.begin() + static_cast<std::ptrdiff_t>(end)));
        auto done = co_await commit(std::move(some));
        if (!done) give_up(done.error());
        heard();
        unwritable_.reset();
        for (const auto& one : *done) newest = std::max(newest, one.revision);
        all.insert(all.end(), done->begin(), done->end());
    }
    co_await catch_up(newest);
    co_return all;
}

// Of a thousand nodes that come at once, each transaction by itself would take longer than they wait.
task<result<std::vector<store_outcome>>> shared_names::commit(std::vector<store_step> steps) {
    auto mine = std::make_shared<queued_write>();
    mine->steps = std::move(steps);
    waiter<> done(on_);
    struct awaited {
        std::list<std::shared_ptr<queued_write>>& queue;
        const std::shared_ptr<queued_write>& what;
        ~awaited() {
            what->author = nullptr;
            queue.remove(what);
        }
    } guard{queue_, mine};
    mine->author = &done;
    queue_.push_back(mine);
    if (writers_ < max_writers) {
        ++writers_;
        scope_.spawn("writes to the store", write_queue(*this));
    }
    while (!mine->outcome) co_await done.wait();
    co_return *mine->outcome;
}

std::vector<std::shared_ptr<shared_names::queued_write>> shared_names::next_group() {
    std::vector<std::shared_ptr<queued_write>> group;
    std::set<std::string, std::less<>> keys;
    std::size_t total = 0;
    for (auto next = queue_.begin(); next != queue_.end() && keys.size() < name_store::max_steps;) {
        const auto& steps = (*next)->steps;
        std::size_t size = 0;
        for (const auto& one : steps) size += one.key.size() + one.value.size();
        const bool fits = keys.size() + steps.size() <= name_store::max_steps && total + size <= max_group_bytes &&
                          std::ranges::none_of(steps, [&](const auto& one) { return keys.contains(one.key); });
        if (!fits && !group.empty()) {
            ++next;
            continue;
        }
        for (const auto& one : steps) keys.insert(one.key);
        total += size;
        group.push_back(*next);
        next = queue_.erase(next);
    }
    return group;
}

task<> shared_names::write_queue(shared_names& self) {
    struct counted {
        std::size_t& all;
        ~counted() { --all; }
    } guard{self.writers_};
    while (!self.queue_.empty()) {
        auto group = self.next_group();
        std::vector<store_step> steps;
        for (const auto& one : group) steps.insert(steps.end(), one->steps.begin(), one->steps.end());
        auto written = co_await self.store_.write(std::move(steps));
        if (!written && written.error().code() == errc::no_such_name && group.size() > 1) { // a lease of one of them
            for (const auto& one : group) {
                auto own = one->steps;
                auto outcome = co_await self.store_.write(std::move(own));
                one->settle(std::move(outcome));
            }
            continue;
        }
        std::size_t at = 0;
        for (const auto& one : group) {
            if (!written) {
                one->settle(written.error());
                continue;
            }
            auto begin = written->begin() + static_cast<std::ptrdiff_t>(at);
            at += one->steps.size();
            one->settle(std::vector<store_outcome>(begin, written->begin() + static_cast<std::ptrdiff_t>(at)));
        }
    }
}

// The registry changes in the order of the store only.
task<> shared_names::catch_up(std::uint64_t revision) {
    auto until = saturating_add(on_.now(), catch_up_time);
    while (revision_ < revision) {
        if (on_.now() >= until) {
            store_.end_watch(); // the next one begins where this one has gone mute
            give_up(failure(errc::timed_out, fmt::format("changes up to {} have not arrived", revision)));
        }
        listed_waiter news(on_, catching_up_);
        timer late(on_, [&news] { news.resume(); });
        late.arm(until);
        co_await news.wait();
    }
}

void shared_names::note_asked(std::uint64_t lease_key) {
    if (auto known = nodes_.find(lease_key); known != nodes_.end()) known->second.asked = on_.now();
}

task<> shared_names::keep_here(naming::node_identity who, duration lease) {
    note_asked(who.lease_key);
    if (auto why = trouble(); !why.empty()) throw error(errc::refused, why);
    const auto key = who.lease_key;
    // The short lease, granted now, ends before that of the store, also by a clock that is a little slow.
    const auto margin = store_lease - names_.options().lease - std::chrono::seconds(1);
    bool was_ending = false;
    for (int attempt = 0; attempt != 4; ++attempt) {
        auto known = nodes_.find(key);
        const bool there = known != nodes_.end();
        if (there && std::exchange(known->second.ending, false)) was_ending = true; // it lives
        // The end of a node may be under way: a record that is written anew prevents it, or shows that it came first.
        if (there && known->second.what.server == incarnation_ && !was_ending) {
            if (confirmed_within(known->second, margin)) co_return;
            auto sent = on_.now();
            auto number = known->second.what.store_lease;
            known->second.tried = sent;
            auto kept = co_await store_.keep(number, name_store::patience);
            known = nodes_.find(key);
            if (kept && known != nodes_.end() && known->second.what.store_lease == number) {
                known->second.confirmed = sent;
                co_return;
            }
            if (!kept && kept.error().code() != errc::no_such_name) give_up(kept.error());
            if (!kept) lose_node(key); // before the store has told it
            continue;
        }
        stored_node record;
        record.who = who;
        record.lease = lease;
        record.server = incarnation_;
        record.store_lease = there ? known->second.what.store_lease : (env_.random() >> 2) | 1;
        auto sent = on_.now();
        if (!there) {
            auto granted = co_await store_.grant(record.store_lease, store_lease);
            if (!granted) give_up(granted.error());
        }
        store_step step;
        step.key = key_of_node(key);
        step.value = to_json(record);
        step.lease = record.store_lease;
        step.expected = there ? known->second.changed : 0;
        std::vector<store_step> steps(1, step);
        auto written = co_await commit(std::move(steps));
        if (!written && written.error().code() == errc::no_such_name) { // the lease has run out meanwhile
            lose_node(key);
            continue;
        }
        if (!written) give_up(written.error());
        unwritable_.reset();
        if (written->front().done) was_ending = false;
        co_await catch_up(written->front().revision);
        known = nodes_.find(key);
        if (written->front().done && !there && known != nodes_.end()) {
            known->second.confirmed = sent;
            known->second.asked = sent;
        }
    }
    throw error(errc::refused, "another name server keeps this node's lease now; ask again");
}

bool shared_names::full_for(std::uint64_t lease_key) const {
    if (nodes_.contains(lease_key) || arriving_.contains(lease_key)) return false;
    const auto others = std::ranges::count_if(arriving_, [&](auto key) { return !nodes_.contains(key); });
    return nodes_.size() + static_cast<std::size_t>(others) >= names_.options().limits.max_nodes;
}

task<naming::register_response> shared_names::enroll(naming::register_request request) {
    naming::register_response response;
    response.server_incarnation = incarnation_;
    auto why = objection_to(request.node, names_.options().limits);
    if (why) {
        for (const auto& claim : request.components)
            response.grants.push_back(answer_of(claim.path, verdict::refused, *why));
        co_return response;
    }
    const auto lease_key = request.node.lease_key;
    const auto lease = std::min(request.lease, names_.options().lease);
    if (full_for(lease_key)) {
        for (const auto& claim : request.components) {
            response.grants.push_back(answer_of(
                claim.path, verdict::wait,
                fmt::format("{} nodes are registered, which is max_nodes", names_.options().limits.max_nodes)));
            response.grants.back().retry_after = lease / 2;
        }
        co_return response;
    }
    struct arrival { // counted from now on, so that nodes that arrive at once do not pass the limit together
        std::set<std::uint64_t>& all;
        std::uint64_t key;
        bool counted;
        arrival(std::set<std::uint64_t>& in, std::uint64_t of) : all(in), key(of), counted(in.insert(of).second) {}
        ~arrival() {
            if (counted) all.erase(key);
        }
    } arriving(arriving_, lease_key);
    auto who = request.node;
    co_await keep_here(std::move(who), lease);
    auto kept = nodes_.find(lease_key);
    if (kept == nodes_.end()) throw error(errc::refused, "the lease of this node has ended meanwhile; ask again");
    const auto store_lease_number = kept->second.what.store_lease;

    struct step_of {
        std::size_t grant;
        store_step what;
    };
    std::vector<step_of> writes;
    std::vector<store_step> erasures; // of a former life: the next one has a higher epoch
    std::set<std::string> seen;
    registry::claims_under_way under_way(names_, lease_key);
    for (auto& claim : request.components) {
        auto& answer = response.grants.emplace_back();
        answer.path = claim.path;
        if (auto unfit = objection_to(claim, names_.options().limits)) {
            answer = answer_of(claim.path, verdict::refused, std::move(*unfit));
            continue;
        }
        if (auto other = names_.held_by_other(claim, lease_key, on_.now())) {
            answer = std::move(*other);
            continue;
        }
        auto full = names_.no_room(claim, lease_key);
        if (full || !seen.insert(claim.path).second) {
            answer = answer_of(claim.path, verdict::wait, full.value_or("it was claimed twice in one request"));
            answer.retry_after = lease / 2;
            continue;
        }
        stored_claim made;
        made.lease_key = lease_key;
        made.store_lease = store_lease_number;
        made.claim = claim;
        made.claim.epoch = made.claim.proof = 0;
        step_of step;
        step.grant = response.grants.size() - 1;
        step.what.key = key_of_name(claim.path);
        step.what.value = to_json(made);
        step.what.lease = store_lease_number;
        if (auto held = known_.find(claim.path); held != known_.end()) {
            if (held->second.value == step.what.value) continue;
            auto before = from_json<stored_claim>(held->second.value);
            if (before.claim.incarnation == claim.incarnation) {
                step.what.expected = held->second.changed;
            } else {
                store_step gone;
                gone.key = step.what.key;
                gone.expected = held->second.changed;
                gone.erase = true;
                erasures.push_back(std::move(gone));
            }
        }
        writes.push_back(std::move(step));
        under_way.add(claim);
    }
    if (!erasures.empty()) co_await write(std::move(erasures));
    std::vector<store_step> steps;
    for (auto& one : writes) steps.push_back(std::move(one.what));
    if (!steps.empty()) co_await write(std::move(steps));

    for (std::size_t i = 0; i != request.components.size(); ++i) {
        auto& answer = response.grants[i];
        if (answer.what != verdict::granted) continue;
        const auto& claim = request.components[i];
        auto held = known_.find(claim.path);
        if (held != known_.end() && held->second.lease_key == lease_key &&
            held->second.store_lease == store_lease_number) {
            answer.epoch = offset_ + held->second.created;
        } else if (auto other = names_.held_by_other(claim, lease_key, on_.now())) {
            answer = std::move(*other);
        } else {
            answer = answer_of(claim.path, verdict::wait, "a lease that has ended still holds it in the store");
            answer.retry_after = lease / 5;
        }
    }
    auto node = nodes_.find(lease_key);
    if (node == nodes_.end() || node->second.what.server != incarnation_)
        throw error(errc::refused, "another name server keeps this node's lease now; ask again");
    naming::renew_request again;
    again.lease_key = lease_key;
    auto renewed = names_.renew(again, on_.now());
    response.lease = renewed.lease;
    response.lease_number = renewed.lease_number;
    names_.offer(request.schemas, response.grants);
    co_return response;
}

task<naming::renew_response> shared_names::renew(naming::renew_request request) {
    note_asked(request.lease_key);
    if (auto why = trouble(); !why.empty()) throw error(errc::refused, why);
    naming::renew_response response;
    response.server_incarnation = incarnation_;
    auto known = nodes_.find(request.lease_key);
    if (known == nodes_.end() || known->second.ending) co_return response;
    auto who = known->second.what.who;
    auto lease = known->second.what.lease;
    co_await keep_here(std::move(who), lease);
    co_return names_.renew(request, on_.now());
}

task<naming::withdraw_response> shared_names::withdraw(naming::withdraw_request request) {
    std::vector<store_step> steps;
    std::set<std::string> seen;
    for (const auto& gone : request.departures) {
        auto held = known_.find(gone.path);
        if (held == known_.end() || held->second.lease_key != request.lease_key || !seen.insert(gone.path).second)
            continue;
        if (from_json<stored_claim>(held->second.value).claim.incarnation != gone.incarnation) continue;
        store_step step;
        step.key = key_of_name(gone.path);
        step.expected = held->second.changed;
        step.erase = true;
        steps.push_back(std::move(step));
    }
    if (!steps.empty()) co_await write(std::move(steps));
    names_.withdraw(request, on_.now()); // what it had lost
    if (auto known = nodes_.find(request.lease_key);
        known != nodes_.end() &&
        std::ranges::none_of(known_, [&](const auto& one) { return one.second.lease_key == request.lease_key; })) {
        known->second.ending = true;
        co_await end_node(*this, request.lease_key);
    }
    co_return naming::withdraw_response();
}

task<naming::ended_response> shared_names::end(naming::ended_request request) {
    if (request.launch_mark.size() < naming::min_mark_bytes) co_return names_.end(request, on_.now()).value();
    naming::ended_response response;
    for (auto key : names_.marked(request.launch_mark)) {
        if (auto known = nodes_.find(key); known != nodes_.end()) known->second.ending = true;
        co_await end_node(*this, key);
        ++response.nodes;
    }
    co_return response;
}

// Nobody else may have taken it over: the record goes first, under that condition, and then its lease with the names.
task<> shared_names::end_node(shared_names& self, std::uint64_t lease_key) {
    auto known = self.nodes_.find(lease_key);
    if (known == self.nodes_.end() || !known->second.ending) co_return; // it has come back
    auto number = known->second.what.store_lease;
    store_step step;
    step.key = key_of_node(lease_key);
    step.expected = known->second.changed;
    step.erase = true;
    std::vector<store_step> steps(1, step);
    auto written = co_await self.commit(std::move(steps));
    if (!written) {
        self.obstacle_ = written.error().message();
        co_return; // nobody renews it, and it is ended as soon as the store answers
    }
    if (!written->front().done) co_return;
    auto revoked = co_await self.store_.revoke(number);
    if (!revoked) self.log_.debug("a lease was not revoked", {{"cause", revoked.error().message()}});
}

bool shared_names::answers_slowly() const {
    return answer_took_ > prompt || (asked_at_ && on_.now() - *asked_at_ > prompt);
}

void shared_names::tick() {
    if (!store_answers_) return; // nodes whose renewals are refused are alive all the same
    for (auto key : names_.take_overdue()) {
        auto known = nodes_.find(key);
        if (known == nodes_.end() || known->second.what.server != incarnation_ || known->second.ending) continue;
        if (answers_slowly() && names_.silent_for(key, on_.now()) < store_lease) {
            names_.extend(key, names_.options().lease, on_.now());
            continue;
        }
        known->second.ending = true;
        scope_.spawn("end of a node", end_node(*this, key));
    }
}

// While the store was away renewals were refused. A node that is kept here may be asking other name servers, some of
// which still do not reach the store: it gets as long as by its lease there to come back.
void shared_names::give_time() {
    [[maybe_unused]] auto refused = names_.take_overdue();
    for (const auto& [key, one] : nodes_)
        if (one.what.server == incarnation_ && !one.ending) names_.extend(key, store_lease, on_.now());
}

task<> shared_names::tend(shared_names& self) {
    while (!self.scope_.stopping()) {
        const auto asked = self.on_.now();
        const auto seen = self.revision_;
        self.asked_at_ = asked;
        auto alive = co_await self.store_.probe();
        self.asked_at_.reset();
        self.answer_took_ = self.on_.now() - asked;
        if (alive) self.heard();
        else self.obstacle_ = alive.error().message();
        if (!alive) self.names_.heard_since(self.on_.now());
        if (alive && *alive < seen) {
            self.read_ = false;
            self.obstacle_ = "it was restored from a backup, and is read anew";
        }
        if (!self.read_) self.store_.end_watch(); // it waits for revisions that are far away; also one just begun
        const bool answered = std::exchange(self.store_answers_, static_cast<bool>(alive));
        if (alive && !answered) self.give_time();
        auto why = self.trouble();
        if (self.on_.now() - self.started_ < fresh) why.clear();
        if (!why.empty() && !std::exchange(self.complained_, true)) self.log_.warning(why);
        if (why.empty() && std::exchange(self.complained_, false)) self.log_.info("the store is back");
        std::vector<std::uint64_t> dead;
        if (alive)
            for (const auto& [key, one] : self.nodes_)
                if (one.what.server == self.incarnation_ && one.ending) dead.push_back(key);
        for (auto key : dead) co_await end_node(self, key);
        co_await sleep_for(self.on_, tend_period);
    }
}

task<> shared_names::pulse(shared_names& self) {
    while (!self.scope_.stopping()) {
        const std::chrono::milliseconds own_time(static_cast<std::int64_t>(self.env_.random() % 2000));
        auto silent_since = std::max(self.news_at_, self.pulsed_at_);
        co_await sleep_until(self.on_, saturating_add(silent_since, pulse_period + own_time));
        if (self.on_.now() - self.news_at_ < pulse_period) continue;
        self.pulsed_at_ = self.on_.now();
        if (!self.read_ || !self.store_answers_) continue;
        store_step step;
        step.key = pulse_key;
        step.value = fmt::format("{:016x}", self.incarnation_);
        step.expected = self.pulse_;
        std::vector<store_step> steps(1, step);
        try {
            co_await self.write(std::move(steps));
        } catch (const error& mute) {
            if (mute.code() == errc::cancelled) throw;
            self.log_.debug("the watch of the store is silent", {{"cause", std::string(mute.what())}});
        }
    }
}

bool shared_names::due(const known_node& node) const {
    return node.what.server == incarnation_ && !node.ending && node.asked && on_.now() - *node.asked < keep_silent &&
           !confirmed_within(node, keep_period) && (!node.tried || on_.now() - *node.tried >= keep_period);
}

// Whatever `tend` finds: a store that answers too late for grants still gets the renewals in time.
task<> shared_names::keep_leases(shared_names& self) {
    while (!self.scope_.stopping()) {
        std::vector<std::uint64_t> all;
        for (const auto& [key, one] : self.nodes_)
            if (self.due(one)) all.push_back(key);
        for (auto key : all) {
            if (self.keeping_ >= few_keeps) co_await sleep_for(self.on_, keep_pace);
            while (self.keeping_ >= max_keeps) co_await sleep_for(self.on_, keep_pace);
            auto known = self.nodes_.find(key);
            if (known == self.nodes_.end() || !self.due(known->second)) continue;
            known->second.tried = self.on_.now();
            ++self.keeping_;
            self.scope_.spawn("a lease in the store", keep_lease(self, key, known->second.what.store_lease));
        }
        co_await sleep_for(self.on_, tend_period);
    }
}

task<> shared_names::keep_lease(shared_names& self, std::uint64_t lease_key, std::uint64_t number) {
    struct counted {
        std::size_t& all;
        ~counted() { --all; }
    } guard{self.keeping_};
    const auto sent = self.on_.now();
    auto kept = co_await self.store_.keep(number, keep_patience);
    auto known = self.nodes_.find(lease_key);
    if (known == self.nodes_.end() || known->second.what.store_lease != number) co_return;
    if (kept) known->second.confirmed = std::max(known->second.confirmed.value_or(sent), sent);
    // Otherwise the watch tells that the lease is over. A store that was found to be away is not asked more often.
    else if (kept.error().code() != errc::no_such_name && self.store_answers_) known->second.tried.reset();
}

} // namespace ise
