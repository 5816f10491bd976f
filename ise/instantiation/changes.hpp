#pragma once
#include <ise/instantiation/prober.hpp>
#include <ise/instantiation/starts.hpp>
#include <ise/instantiation/state_keeper.hpp>

#include <set>
#include <string>
#include <vector>

namespace ise::instantiation {

/// Makes running instances as they are wanted: in place where all that differs can be changed so, else by a restart,
/// which is undone if it fails.
class changes {
public:
    changes(server_context& here, installed_types& types, instance_table& table, state_keeper& state,
            supervisor& instances, prober& probes, shared_processes& shared, starts& starting)
        : here_(here), types_(types), table_(table), state_(state), instances_(instances), probes_(probes),
          shared_(shared), starting_(starting) {}

    /// Returns how it was changed, or why it was not. errc::refused: there is no such instance, it has something
    /// against it, or the change cannot be undone. Cancellation: terminal; an instance that was being restarted is what
    /// it was before, and runs if it ran.
    /// errc::access_denied: the access policy does not let `by`, who lives as long as it runs.
    task<change_response> change(change_request what, const verified_peer* by);
    /// Sets parameters in place. errc::refused with what can be set, or where they are set and not on the disk.
    /// Cancellation: terminal; the parameters may have been set.
    task<set_response> set(set_request what);

private:
    task<change_response> change_to(start_request to, bool only_in_place, const verified_peer* by);
    task<result<void>> set_parameters(instance_ptr one, std::vector<argument> settings);
    /// It is what it was before a change, and runs `again` so.
    void roll_back(const instance_ptr& one, start_request asked, launch_plan plan, bool again);
    void become(const instance_ptr& one, start_request asked, launch_plan plan);

    server_context& here_;
    installed_types& types_;
    instance_table& table_;
    state_keeper& state_;
    supervisor& instances_;
    prober& probes_;
    shared_processes& shared_;
    starts& starting_;
    std::set<std::string> changing_; // paths
};

} // namespace ise::instantiation
