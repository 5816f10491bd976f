#pragma once
#include <ise/instantiation/state_keeper.hpp>

#include <functional>
#include <map>
#include <string>
#include <utility>

namespace ise::instantiation {

/// Does what the supervision of each instance decides, and makes its changes known: to the disk, to subscribers, to
/// those who wait for it.
class supervisor {
public:
    /// What other parts do for it.
    struct actions {
        std::function<void(const instance_ptr&)> launch;  ///< a process for its present life
        std::function<void(const instance_ptr&)> changed; ///< something of it may have changed
        std::function<void(const host_event&)> publish;   ///< its state, or what it is, has changed
    };

    supervisor(server_context& here, instance_table& table, state_keeper& state, actions does)
        : here_(here), table_(table), state_(state), does_(std::move(does)) {}

    /// Throws errc::overloaded where the state has no room for that request.
    void check_room(const start_request& more) const { state_.check_room(more); }
    /// A new instance, which is woken when its supervision wants it.
    instance_ptr add(start_request request, launch_plan plan);
    /// Its supervision continues from what was known and published before.
    void published(const std::string& path, instance_state state, std::string reason);
    void forget(const std::string& path);

    void carry_out(const instance_ptr& one, supervision::act what);
    /// Its process of that life has ended.
    void ended(const instance_ptr& one, std::uint64_t life, process_end how);
    /// After its supervision was changed by hand.
    void changed(const instance_ptr& one);
    /// It is something else from now on: that is saved and published.
    void announce(const instance& one);
    /// No instance is woken any more, and none of their processes is watched.
    void stop();

private:
    server_context& here_;
    instance_table& table_;
    state_keeper& state_;
    actions does_;
    std::map<std::string, std::pair<instance_state, std::string>> published_; // of each path, the last
};

} // namespace ise::instantiation
