#pragma once
#include <ise/instantiation/installed_types.hpp>
#include <ise/instantiation/instance_names.hpp>
#include <ise/instantiation/shared_processes.hpp>

#include <vector>

namespace ise::instantiation {

/// Throws why a component of this host could not listen there now.
void check_endpoints(component& self, const std::vector<endpoint>& wanted);

/// What would be against a start, before anything is started.
class start_checks {
public:
    start_checks(server_context& here, installed_types& types, const instance_table& table, instance_names& names,
                 const shared_processes& shared)
        : here_(here), types_(types), table_(table), names_(names), shared_(shared) {}

    /// One outcome for each that is wanted. errc::overloaded: they are too many. Cancellation: terminal.
    task<checks_response> check(checks_request request);

private:
    task<checked_start> check_one(start_request request, std::vector<endpoint>& wanted);
    bool compare_environment(const instance_ptr& one, const start_request& wanted);

    server_context& here_;
    installed_types& types_;
    const instance_table& table_;
    instance_names& names_;
    const shared_processes& shared_;
};

} // namespace ise::instantiation
