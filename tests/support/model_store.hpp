// A store like etcd for the virtual world: keys with revisions, leases, watches that end by compaction, and faults.
#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/sleep.hpp>
#include <ise/name_server/name_store.hpp>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace ise_test {

/// What all name servers of a test share. `clock` is the time of the world.
struct model_cluster {
    struct entry {
        std::string value;
        std::uint64_t created = 0, changed = 0, lease = 0;
    };
    struct lease {
        ise::duration length{};
        ise::time_point expires{};
    };

    std::function<ise::time_point()> clock;
    std::map<std::string, entry> keys;
    std::map<std::uint64_t, lease> leases;
    std::vector<ise::store_change> history; // after `compacted`
    std::uint64_t revision = 1, compacted = 0;
    std::size_t transactions = 0;
    int restored = 0; ///< how often it was
    // Faults.
    bool majority = true;                         ///< false: nothing is answered
    std::set<std::string> cut_off;                ///< name servers that reach a minority only
    std::set<std::string> answers_lost;           ///< what they write is done, and they do not hear of it
    std::map<std::string, ise::duration> latency; ///< of one way; who waits less long for an answer gives up
    std::set<std::string> unanswered;             ///< name servers that only their watch still works for
    bool full = false;                            ///< NOSPACE: nothing is written
    std::set<std::string> mute;                   ///< name servers whose present watch reports nothing any more

    void gone(const std::string& key) {
        ise::store_change made;
        made.gone = true;
        made.entry.key = key;
        made.entry.changed = revision;
        history.push_back(std::move(made));
        keys.erase(key);
    }
    void end(std::uint64_t number) {
        std::vector<std::string> with;
        for (const auto& [key, one] : keys)
            if (one.lease == number) with.push_back(key);
        if (!with.empty()) ++revision;
        for (const auto& key : with) gone(key);
        leases.erase(number);
    }
    /// Leases do not end without a majority; the next leader gives them their whole length again.
    void advance() {
        auto now = clock();
        if (!majority) {
            for (auto& [number, one] : leases) one.expires = now + one.length;
            return;
        }
        std::vector<std::uint64_t> over;
        for (const auto& [number, one] : leases)
            if (one.expires <= now) over.push_back(number);
        for (auto number : over) end(number);
    }
    struct backup {
        std::map<std::string, entry> keys;
        std::map<std::uint64_t, lease> leases;
        std::vector<ise::store_change> history;
        std::uint64_t revision = 0, compacted = 0;
    };
    backup make_backup() const { return {keys, leases, history, revision, compacted}; }
    /// Watches end, and leases begin anew.
    void restore(backup from) {
        keys = std::move(from.keys);
        leases = std::move(from.leases);
        history = std::move(from.history);
        revision = from.revision;
        compacted = from.compacted;
        for (auto& [number, one] : leases) one.expires = clock() + one.length;
        ++restored;
    }
    void compact() {
        compacted = revision;
        history.clear();
    }
};

class model_store final : public ise::name_store {
public:
    model_store(model_cluster& of, ise::loop& on, std::string who) : of_(of), on_(on), who_(std::move(who)) {}

    ise::task<ise::result<ise::store_snapshot>> read() override {
        const auto until = on_.now() + patience;
        auto way = co_await reach(until);
        if (!way) co_return way.error();
        ise::store_snapshot all;
        all.revision = of_.revision;
        for (const auto& [key, one] : of_.keys) {
            ise::store_entry made;
            made.key = key;
            made.value = one.value;
            made.created = one.created;
            made.changed = one.changed;
            all.entries.push_back(std::move(made));
        }
        auto back = co_await hear(until);
        if (!back) co_return back.error();
        co_return all;
    }

    ise::task<ise::result<std::vector<ise::store_outcome>>> write(std::vector<ise::store_step> steps) override {
        const auto until = on_.now() + patience;
        auto way = co_await reach(until);
        if (!way) co_return way.error();
        ++of_.transactions;
        if (of_.full) co_return ise::failure(ise::errc::refused, "database space exceeded");
        for (const auto& one : steps)
            if (one.lease != 0 && !of_.leases.contains(one.lease))
                co_return ise::failure(ise::errc::no_such_name, "requested lease not found");
        std::vector<ise::store_outcome> outcomes;
        const auto next = of_.revision + 1;
        for (auto& step : steps) {
            auto held = of_.keys.find(step.key);
            ise::store_outcome outcome;
            const auto changed = held == of_.keys.end() ? 0 : held->second.changed;
            outcome.done = changed == step.expected;
            outcome.revision = outcome.done ? next : changed;
            if (outcome.done) of_.revision = next;
            if (outcome.done && step.erase) {
                of_.gone(step.key);
            } else if (outcome.done) {
                auto& made = of_.keys[step.key];
                if (step.expected == 0) made.created = next;
                made.changed = next;
                made.value = step.value;
                made.lease = step.lease;
                ise::store_change change;
                change.entry.key = step.key;
                change.entry.value = made.value;
                change.entry.created = made.created;
                change.entry.changed = next;
                of_.history.push_back(std::move(change));
            }
            outcomes.push_back(outcome);
        }
        auto back = co_await hear(until);
        if (!back) co_return back.error();
        co_return outcomes;
    }

    ise::task<ise::result<std::uint64_t>> probe() override {
        const auto until = on_.now() + patience;
        auto way = co_await reach(until);
        if (!way) co_return way.error();
        const auto revision = of_.revision;
        auto back = co_await hear(until);
        if (!back) co_return back.error();
        co_return revision;
    }
    ise::task<ise::result<void>> grant(std::uint64_t lease, ise::duration length) override {
        const auto until = on_.now() + patience;
        auto way = co_await reach(until);
        if (!way) co_return way.error();
        of_.leases[lease] = {length, of_.clock() + length};
        auto back = co_await hear(until);
        co_return back;
    }
    ise::task<ise::result<void>> keep(std::uint64_t lease, ise::duration within) override {
        const auto until = on_.now() + within;
        auto way = co_await reach(until);
        if (!way) co_return way.error();
        auto found = of_.leases.find(lease);
        if (found == of_.leases.end()) co_return ise::failure(ise::errc::no_such_name, "requested lease not found");
        found->second.expires = of_.clock() + found->second.length;
        auto back = co_await hear(until);
        co_return back;
    }
    ise::task<ise::result<void>> revoke(std::uint64_t lease) override {
        const auto until = on_.now() + patience;
        auto way = co_await reach(until);
        if (!way) co_return way.error();
        of_.end(lease);
        auto back = co_await hear(until);
        co_return back;
    }

    ise::task<ise::failure> follow(
        std::uint64_t revision,
        std::function<void(const std::vector<ise::store_change>&, std::uint64_t)> on_changes) override {
        bool mute = false;
        watch_ended_ = false;
        const auto restored = of_.restored;
        for (;;) {
            if (watch_ended_ || of_.restored != restored)
                co_return ise::failure(ise::errc::peer_lost, "the watch was ended");
            if (of_.mute.erase(who_) > 0) mute = true;
            if (mute) {
                co_await ise::sleep_for(on_, std::chrono::milliseconds(5));
                continue;
            }
            const auto until = on_.now() + patience;
            auto way = co_await reach(until);
            if (!way) co_return way.error();
            if (revision < of_.compacted) co_return ise::failure(ise::errc::superseded, "was compacted");
            std::vector<ise::store_change> news;
            for (const auto& one : of_.history)
                if (one.entry.changed > revision) news.push_back(one);
            revision = std::max(revision, of_.revision); // one that is not reached yet is waited for
            // A watch ends with the first question that its member answers too late.
            if (2 * one_way() > patience) {
                co_await ise::sleep_until(on_, until);
                co_return timed_out("the watch was given up");
            }
            if (!news.empty()) on_changes(news, revision);
            co_await ise::sleep_for(on_, std::chrono::milliseconds(5));
        }
    }

    void end_watch() override { watch_ended_ = true; }

private:
    static ise::failure timed_out(const char* why) { return ise::failure(ise::errc::timed_out, why); }
    ise::duration one_way() const {
        auto late = of_.latency.find(who_);
        return late == of_.latency.end() ? ise::duration(std::chrono::milliseconds(1)) : late->second;
    }
    bool away() const { return !of_.majority || of_.cut_off.contains(who_); }
    // A request that is under way for longer than its sender waits is lost.
    ise::task<ise::result<void>> reach(ise::time_point until) {
        auto there = on_.now() + one_way();
        co_await ise::sleep_until(on_, std::min(there, until));
        of_.advance();
        if (there < until && !away()) co_return ise::result<void>();
        co_await ise::sleep_until(on_, until);
        co_return timed_out(away() ? "no leader" : "etcd did not answer in time");
    }
    ise::task<ise::result<void>> hear(ise::time_point until) {
        auto back = of_.unanswered.contains(who_) ? ise::time_point::max() : on_.now() + one_way();
        co_await ise::sleep_until(on_, std::min(back, until));
        if (of_.answers_lost.contains(who_)) co_return timed_out("the answer was lost");
        if (back > until) co_return timed_out("etcd did not answer in time");
        co_return ise::result<void>();
    }

    model_cluster& of_;
    ise::loop& on_;
    std::string who_;
    bool watch_ended_ = false;
};

} // namespace ise_test
