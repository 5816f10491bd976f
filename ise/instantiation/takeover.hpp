#pragma once
#include <ise/instantiation/installed_types.hpp>
#include <ise/instantiation/launcher.hpp>

namespace ise::instantiation {

/// Goes on with what an instantiation server before this one had started.
class takeover {
public:
    takeover(server_context& here, installed_types& types, supervisor& instances, instance_names& names,
             shared_processes& shared, launcher& processes)
        : here_(here), types_(types), instances_(instances), names_(names), shared_(shared), processes_(processes) {}

    /// Once, before anything is started and before the state is saved.
    void restore(const saved_state& before);

private:
    void restore(const saved_instance& before, bool same_boot);
    bool find_process(const instance_ptr& one, const saved_instance& before, bool same_boot);

    server_context& here_;
    installed_types& types_;
    supervisor& instances_;
    instance_names& names_;
    shared_processes& shared_;
    launcher& processes_;
};

} // namespace ise::instantiation
