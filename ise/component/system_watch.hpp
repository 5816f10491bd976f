#pragma once
#include <ise/component/component.hpp>
#include <ise/component/introspection.hpp>
#include <ise/component/parameter.hpp>
#include <ise/core/endpoint.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

/// What gateways and bridges show of a running system, and how they learn what there is.
namespace ise {

/// Components and services that somebody wants of a system.
struct service_selection {
    std::vector<std::string> paths;    ///< components, each with those below it; none: all
    std::vector<std::string> services; ///< only these; none: all
    std::vector<std::string> except;   ///< services that are left out
    bool own_services = false;         ///< ISE's own, such as `ise.health`

    bool has(const std::string& path) const;
    bool has(const service_info& service) const; ///< provided ones only
    /// Adds `show`, `only` and `except`, bound to this selection, which must outlive the set.
    void add_to(parameter_set& set);
};

/// The callbacks of a `system_watch`, on the component's loop.
struct system_news {
    /// A component is there, or has restarted with other services: what it is.
    std::function<void(const std::string& path, component_info about)> described;
    /// A component's name is no longer registered; also for one that was never described.
    std::function<void(const std::string& path)> gone;
    /// The name server or a component cannot be asked; it is tried again.
    std::function<void(const std::string& what)> trouble;
};

/// Follows the names of a system, and asks each component what it provides. The component's own path is left out. Used
/// on the loop of its component.
class system_watch {
public:
    /// Follows the paths of `wanted`. `name_servers`: default ISE_NAME_SERVER, else that of this machine. `self` must
    /// outlive it; no callback is called once it is destroyed.
    system_watch(component& self, service_selection wanted, std::vector<endpoint> name_servers, system_news news);
    ~system_watch();
    system_watch(const system_watch&) = delete;
    system_watch& operator=(const system_watch&) = delete;

private:
    struct state;
    std::shared_ptr<state> state_;
};

} // namespace ise
