#pragma once
#include <ise/core/log.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/core/waiter.hpp>
#include <ise/name_server/name_store.hpp>
#include <ise/name_server/registry.hpp>

#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace ise {

/// The names of a store that several name servers share, as one of them serves them: its registry shows what the store
/// has, and changes only when the store reports a change. A name is granted by one transaction on the absence of its
/// key. Its epoch is an offset, which the first server writes once, plus the revision in which the key appeared.
///
/// A node's short lease is kept by the server that it talks to; in the store it has one lease of `store_lease`, which
/// that server renews, and which takes its names with it. Another server takes a node over by writing its record. Who
/// does not hear from a majority of the store grants and renews nothing (errc::refused).
class shared_names {
public:
    /// Of a node in the store: longer than a name server needs to be replaced.
    static constexpr duration store_lease = std::chrono::seconds(10);

    /// `on_change` is called after each change of the registry. All outlive the coroutines in `scope`.
    shared_names(loop& on, environment& env, task_scope& scope, const logger& to, name_store& store, registry& names,
                 std::uint64_t incarnation, std::function<void()> on_change);

    /// Errors: errc::refused, as `trouble()`. Cancellation: terminal; the store may have acted.
    task<naming::register_response> enroll(naming::register_request request);
    /// Errors: errc::refused, as `trouble()`. Cancellation: terminal; the store may have acted.
    task<naming::renew_response> renew(naming::renew_request request);
    /// Errors: errc::refused, as `trouble()`. Cancellation: terminal; the store may have acted.
    task<naming::withdraw_response> withdraw(naming::withdraw_request request);
    /// Errors: errc::refused for a mark that is too short. Cancellation: terminal.
    task<naming::ended_response> end(naming::ended_request request);

    /// Ends nodes that were silent. Called as often as `registry::advance`.
    void tick();
    /// Why nothing can be granted now, for people; empty: nothing is known against it.
    std::string trouble() const;
    /// As `trouble()`; also while the store answers but refuses to write, such as for want of space.
    std::string report() const;

private:
    struct node_record {
        naming::node_identity who;
        duration lease{};
        std::uint64_t store_lease = 0;
        std::uint64_t server = 0; // incarnation
    };
    struct known_node {
        node_record what;
        std::uint64_t changed = 0;
        std::optional<time_point> confirmed; // when the last renewal in the store was sent that succeeded
        std::optional<time_point> tried;     // when the last one was sent, or nothing: it failed at once
        std::optional<time_point> asked;     // when it asked this server for something last, in vain or not
        bool ending = false;
    };
    struct known_name {
        std::string value;
        std::uint64_t lease_key = 0, created = 0, changed = 0, store_lease = 0;
    };

    struct queued_write {
        std::vector<store_step> steps;
        std::optional<result<std::vector<store_outcome>>> outcome;
        waiter<>* author = nullptr; // null: nobody waits for the outcome any more

        void settle(result<std::vector<store_outcome>> with) {
            outcome.emplace(std::move(with));
            if (author) author->resume();
        }
    };

    static task<> watch(shared_names& self);
    static task<> tend(shared_names& self);
    static task<> keep_leases(shared_names& self);
    static task<> pulse(shared_names& self);
    static task<> keep_lease(shared_names& self, std::uint64_t lease_key, std::uint64_t number);
    static task<> end_node(shared_names& self, std::uint64_t lease_key);
    task<result<void>> read_all();
    /// Forgets the revisions seen so far: the store was restored from a backup, and everything read next is newer.
    void begin_anew();
    void apply(const std::vector<store_change>& changes, std::uint64_t revision);
    void apply(const store_change& change);
    void take_node(const store_entry& entry);
    void take_name(const store_entry& entry);
    void lose_node(std::uint64_t lease_key);
    void give_time();
    /// The node is kept by this server, with a lease in the store that holds long enough.
    task<> keep_here(naming::node_identity who, duration lease);
    task<std::vector<store_outcome>> write(std::vector<store_step> steps);
    /// `name_store::write`, together with what others want to write at that time.
    task<result<std::vector<store_outcome>>> commit(std::vector<store_step> steps);
    static task<> write_queue(shared_names& self);
    std::vector<std::shared_ptr<queued_write>> next_group();
    task<> catch_up(std::uint64_t revision);
    [[noreturn]] void give_up(const failure& why);
    bool confirmed_within(const known_node& node, duration age) const {
        return node.confirmed && on_.now() - *node.confirmed < age;
    }
    bool full_for(std::uint64_t lease_key) const;
    void note_asked(std::uint64_t lease_key);
    bool due(const known_node& node) const;
    bool answers_slowly() const;
    void heard() { heard_at_ = on_.now(); }

    loop& on_;
    environment& env_;
    task_scope& scope_;
    const logger& log_;
    name_store& store_;
    registry& names_;
    std::uint64_t incarnation_;
    std::function<void()> on_change_;
    time_point started_;
    by_number<known_node> nodes_;                          // by lease key
    std::map<std::string, known_name, std::less<>> known_; // by path
    std::uint64_t offset_ = 0;
    std::uint64_t revision_ = 0; // up to which the registry is complete
    bool read_ = false;
    time_point heard_at_ = time_point::min(); // of a majority
    std::string obstacle_ = "it was not reached yet";
    std::optional<std::pair<time_point, std::string>> unwritable_; // the last write was refused: when, and why
    bool complained_ = false;
    bool store_answers_ = true;          // the last question whether it does
    duration answer_took_{};             // to that question
    std::optional<time_point> asked_at_; // that question again, which is not answered yet
    std::set<std::uint64_t> arriving_;   // nodes that are being written; `nodes_` has some of them already
    std::size_t keeping_ = 0;            // renewals that are not answered yet
    std::list<std::shared_ptr<queued_write>> queue_;
    std::size_t writers_ = 0; // that empty it
    std::vector<waiter<>*> catching_up_;
    time_point news_at_;      // by the watch
    time_point pulsed_at_{};  // written here
    std::uint64_t pulse_ = 0; // `changed` of its key
};

} // namespace ise
