#pragma once
#include <ise/component/component.hpp>
#include <ise/name_server/name_store.hpp>
#include <ise/name_server/registry.hpp>
#include <ise/name_server/server_memory.hpp>

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>

namespace ise {

/// Options of the name server.
struct name_server_options {
    /// The longest lease that is granted. For this time after its start, names are also reserved for their former
    /// holders: see `registry_options::recovery`.
    duration lease = std::chrono::seconds(2);
    /// There was no name server before: names are granted at once.
    bool fresh = false;
    registry_limits limits; ///< of its memory
    /// State that outlives it. Without it the next name server cannot distinguish a returning holder from a component
    /// that claims its name (docs/security.md), and epochs increase only as far as the clock and returning holders
    /// show.
    std::shared_ptr<server_memory> memory;
    /// Makes the store that this name server shares with others, on its loop; then `memory` and `fresh` do not count.
    /// Empty: names are kept in memory, by this name server alone.
    std::function<std::unique_ptr<name_store>(environment&, loop&)> store;
};

class shared_names;

/// The name server: an ordinary component that serves a `registry` (ise/naming/services.hpp). It is
/// started with `registers = false` in a node with `use_names = false`, on a well-known endpoint:
///
///     component_options options;
///     options.listen = {default_name_server()};
///     options.registers = false;
///     node.start<name_server>(std::string(naming::server_path), options);
class name_server final : public component {
public:
    /// To be started by `node::start`.
    explicit name_server(name_server_options options = name_server_options());
    ~name_server() override;

    /// On its loop; null before it runs.
    const registry* names() const noexcept { return registry_.get(); }

private:
    task<> run() override;
    /// What the access policy leaves of a request, and its answers for the rest.
    struct judged {
        /// To one claim of the request.
        struct answer {
            std::string path;     ///< that is claimed
            std::string against;  ///< what the policy has against it; empty: nothing
            bool refused = false; ///< by the policy
        };
        std::vector<answer> answers;
        bool all_refused = false;
    };
    judged judge(naming::register_request& request, const verified_peer* by);
    void provide_own_names();
    void provide_shared_names();
    task<naming::await_response> wait_for(std::string path, std::uint64_t other_than, time_point until);
    /// Completes the answer to what `judge` has left.
    static void merge(const judged& all, naming::register_response& response);
    naming::register_response enroll(naming::register_request request, const verified_peer* by);
    task<naming::register_response> enroll_shared(naming::register_request request, const verified_peer* by);
    /// What every change ends with: watchers hear of it, and those who wait for a name.
    void changed();
    void recall();
    void keep_ahead();
    void welcome(std::uint64_t watcher);
    void provide_role_changes();
    void tell_members(const std::string& role, const std::function<bool(const subscriber_info&)>& whom);
    void tell_watchers(const std::string& role);
    void wake_waiting(const std::string& path);
    void tick();

    struct watcher {
        std::string prefix;
        bool has_snapshot = false;
    };

    name_server_options options_;
    registry_memory memory_;
    std::unique_ptr<registry> registry_;
    std::unique_ptr<name_store> store_;
    std::unique_ptr<shared_names> shared_; // over the store
    publication<subscription<naming::name_events, naming::watch_request>> events_;
    std::map<std::uint64_t, watcher> watchers_; // by the subscriber's number
    publication<subscription<naming::role_members, naming::role_request>> role_changes_;
    std::map<std::uint64_t, std::string> role_watchers_;                 // by the subscriber's number: the role
    std::map<std::string, std::map<std::string, std::int32_t>> claimed_; // paths with roles, as the audit log has them
    bool recovering_ = true;
    std::multimap<std::string, waiter<>*> waiting_; // for names
    std::unique_ptr<timer> tick_;
};

} // namespace ise
