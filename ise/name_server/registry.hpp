#pragma once
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>
#include <ise/name_server/registry_limits.hpp>
#include <ise/name_server/schema_store.hpp>
#include <ise/name_server/secret_hash.hpp>
#include <ise/naming/services.hpp>

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace ise {

/// What a registry has to know of the servers that ran before it, and the next one of it.
struct registry_memory {
    std::array<std::uint64_t, 2> secret{}; ///< proves grants
    std::uint64_t epochs_below = 0;        ///< every grant of theirs was below it
    bool of_former = false;                ///< their grants are proved by this secret; else it is new
};

struct registry_options {
    duration lease = std::chrono::seconds(2); ///< the longest that is granted
    /// After a start only those who held names before get them, for as long as this: nobody else takes a name that its
    /// holder has not yet been able to renew. The longest lease, where a server may have run before.
    duration recovery = std::chrono::seconds(2);
    registry_limits limits;
    bool shared = false; ///< names come from a store (`shared_names`): `hold` and `drop`; leases end by `end_node`
};

/// Who holds which name, and until when: the decisions of the name server, without its services. Times are passed in
/// and never go back.
///
/// Epochs: each grant has a higher one than every grant before it, also of a server that ran before. Counting starts at
/// the wall clock's microseconds, which a server that grants less than a million names a second cannot overtake, or
/// above what is remembered of the server before, and goes above every epoch that a holder shows who returns during the
/// recovery. (After a clock that went back, these two keep the order.) Who shows one that neither this server nor a
/// clock can have given gets the next one: it moves nobody else's.
///
/// A claim that shows an epoch is a holder's only with the proof that came with the grant: epochs are listed, so that
/// anybody can show one. Where nothing is remembered of the server before, its grants cannot be proved, and during the
/// recovery whoever shows an epoch is believed.
///
/// Time in which the server itself did not run (`advance` was not called) expires no lease: the renewals of that time
/// still wait to be read.
class registry {
public:
    registry(registry_options options, std::uint64_t incarnation, time_point now, wall_time wall,
             registry_memory memory = registry_memory());

    naming::register_response enroll(const naming::register_request& request, time_point now);
    naming::renew_response renew(const naming::renew_request& request, time_point now);
    void withdraw(const naming::withdraw_request& request, time_point now);
    /// Errors: errc::refused for a mark that is too short to be a secret.
    result<naming::ended_response> end(const naming::ended_request& request, time_point now);

    // Of a store that several registries share, which decides who holds what.

    /// A node of the store; its lease ends here, or is kept by another server.
    void know_node(const naming::node_identity& who, duration lease, bool kept_here, time_point now);
    /// Ends a lease, and the names under it.
    void end_node(std::uint64_t lease_key, time_point now);
    /// The node that was known before holds the name under `claim.epoch`.
    void hold(std::uint64_t lease_key, naming::component_claim claim, time_point now);
    /// Nobody holds it now.
    void drop(std::string_view path, time_point now);
    /// The lease of a node kept here ends at least so much later than now, though nothing was heard of it.
    void extend(std::uint64_t lease_key, duration by, time_point now);
    /// Since the lease of a node kept here was renewed.
    duration silent_for(std::uint64_t lease_key, time_point now);
    /// The nodes kept here whose leases have run out since it was last asked.
    std::vector<std::uint64_t> take_overdue();
    /// The nodes whose processes were started with that mark.
    std::vector<std::uint64_t> marked(const std::string& launch_mark) const;
    /// Keeps schemas that the granted services name; the reason for those that are none goes into the grants.
    void offer(const std::vector<naming::schema_text>& schemas, std::vector<naming::grant>& grants);
    /// The store has been heard without a break since then: what another server keeps may have been renewed.
    void heard_since(time_point now) { heard_since_ = running_time(now); }
    /// Whether all names of the store are known. Until then none is said not to exist.
    void complete(bool known) { recovered_ = known ? time_point::min() : time_point::max(); }
    /// The answer to a claim for what another holds; nothing: nobody does, or the same node.
    std::optional<naming::grant> held_by_other(const naming::component_claim& claim, std::uint64_t lease_key,
                                               time_point now);
    /// Why a claim of a known node has no room now, by the limit's name.
    std::optional<std::string> no_room(const naming::component_claim& claim, std::uint64_t lease_key) const;
    /// Claims on their way into the store, which the limits count until they are forgotten: by then they are held, or
    /// were not written. It outlives neither the registry nor the claims.
    class claims_under_way {
    public:
        claims_under_way(registry& in, std::uint64_t lease_key) : in_(in), lease_key_(lease_key) {}
        ~claims_under_way();
        claims_under_way(const claims_under_way&) = delete;
        claims_under_way& operator=(const claims_under_way&) = delete;
        void add(const naming::component_claim& claim);

    private:
        struct counted {
            const naming::component_claim* claim = nullptr;
            std::size_t names = 0, services = 0, bytes = 0; // more than what is held
        };
        registry& in_;
        std::uint64_t lease_key_;
        std::vector<counted> all_;
    };

    /// Of what peers choose, with this server's secret.
    const secret_hash& hash() const noexcept { return hash_; }

    /// A name, else a role of that path.
    result<naming::resolve_response> resolve(std::string_view path, time_point now);
    /// Who serves a role, best first.
    naming::role_members members_of(std::string_view role, time_point now);
    naming::list_response list(const naming::list_request& request, time_point now);
    naming::lost_response lost(std::string_view prefix, time_point now);
    result<naming::describe_response> describe(std::string_view path, time_point now);
    /// All names below a prefix, for a watcher.
    std::vector<naming::name_event> snapshot(std::string_view prefix) const;

    /// Ends the leases that are over. Called at least every `tick()`.
    void advance(time_point now);
    duration tick() const noexcept { return options_.lease / 4; }
    bool recovering(time_point now);

    /// What has changed since it was last asked, in order.
    std::vector<naming::name_event> take_changes();
    /// The roles among whose members something has changed since it was last asked.
    std::set<std::string> take_changed_roles();

    std::size_t components() const noexcept { return components_.size(); }
    std::size_t services() const noexcept { return services_; }
    std::size_t nodes() const noexcept { return nodes_.size(); }
    std::size_t schemas() const noexcept { return schemas_.size(); }
    std::uint64_t last_epoch() const noexcept { return last_epoch_; }
    const registry_options& options() const noexcept { return options_; }

private:
    struct node {
        naming::node_identity who;
        duration lease{};
        time_point renewed{}; // in the server's own running time, as all below
        time_point expires{};
        std::uint64_t renewals = 0;
        std::uint64_t number = 0; // of the lease
        std::set<std::string> paths;
        std::map<std::string, naming::grant> lost; // names that went to others, until the node says that it knows
    };
    struct component {
        naming::component_claim claim;
        node* owner = nullptr;
    };

    using by_name = std::map<std::string, component, std::less<>>;
    enum class end_of_lease { ran_out, reported }; // reported: by whoever started the process
    struct last_holder {
        std::uint64_t epoch = 0;
        end_of_lease why = end_of_lease::ran_out;
        std::string host_name;
        std::uint64_t process_id = 0;
        time_point at{};
    };

    by_name::iterator find(std::string_view path);
    time_point running_time(time_point now);
    void renew_lease(node& of, time_point at);
    void expire(time_point at);
    void end(by_number<node>::iterator gone, end_of_lease why, time_point at);
    std::uint64_t proof_of(std::string_view path, std::uint64_t epoch, const node& of) const;
    bool granted_here(std::uint64_t epoch) const noexcept { return first_epoch_ != 0 && epoch >= first_epoch_; }
    /// After which who found no room may ask again: it may have been superseded meanwhile, and hears of that within a
    /// lease.
    duration patience() const noexcept { return options_.lease / 2; }
    naming::grant decide(node& from, naming::component_claim claim, time_point at);
    naming::grant accept(node& from, naming::component_claim claim, std::uint64_t epoch);
    naming::grant place(node& from, naming::component_claim claim, std::uint64_t epoch);
    std::string take(const std::vector<naming::schema_text>& schemas);
    std::optional<std::string> no_room(const node& from, const naming::component_claim& claim) const;
    std::optional<std::string> objection_to_roles(const naming::component_claim& claim) const;
    void serve_roles(const component& who);
    void leave_roles(const component& who);
    naming::role_member member(const component& who, std::int32_t priority) const;
    void remove(const std::string& path);
    void remember(const std::string& path, last_holder who);
    /// Its renewals are not heard here.
    bool kept_elsewhere(const node& one) const noexcept { return options_.shared && one.expires == time_point::max(); }
    naming::holder holder_of(const component& held, time_point at) const;
    naming::grant denied(const std::string& path, naming::verdict what, const component& held, time_point at) const;
    naming::listed_name listed(const component& held) const;
    void note(naming::name_change what, const component& held);

    registry_options options_;
    std::uint64_t incarnation_;
    registry_memory memory_;
    std::uint64_t last_epoch_;
    std::uint64_t first_epoch_ = 0; // that was granted anew; those below it are of a server that ran before
    time_point recovered_;          // in running time
    time_point last_seen_;
    duration stalled_{}; // did not run for so long
    secret_hash hash_;
    schema_store schemas_;
    by_name components_;
    std::unordered_map<std::string_view, by_name::iterator, secret_hash> by_path_; // the same: found in one step
    by_number<node> nodes_;                                                        // by lease key
    std::set<std::pair<time_point, std::uint64_t>> expiries_;                      // of nodes
    std::map<std::string, last_holder, std::less<>> last_held_;                    // of names that expired
    std::map<std::string, std::set<std::string>, std::less<>> roles_;              // who serves them, by path
    std::set<std::string> changed_roles_;
    std::size_t services_ = 0;
    std::size_t claims_bytes_ = 0;
    struct {
        std::size_t names = 0, services = 0, bytes = 0;
        std::map<std::uint64_t, std::size_t> by_node;
        std::map<std::string, std::size_t> by_role;
    } under_way_; // of claims that are being written to a store
    std::uint64_t last_lease_ = 0;
    std::vector<naming::name_event> changes_;
    time_point heard_since_{};
    std::vector<std::uint64_t> overdue_; // where names are shared
};

} // namespace ise
