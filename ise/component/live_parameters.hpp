#pragma once
#include <ise/component/parameter_services.hpp>

#include <functional>
#include <memory>

namespace ise {

class component;
class service_host;

/// The parameters of a running component: others read them, and change those that are declared changeable
/// (parameter_services.hpp). Used on the component's loop once that was started with it (component_options).
class live_parameters {
public:
    /// `changed` hears of each change when the variables have their new values, and throws to refuse it: they get their
    /// former ones back then. `keeps` holds the variables.
    live_parameters(parameter_set set, std::function<void(component&)> changed, std::shared_ptr<const void> keeps);

    /// Provides the three services, for as long as the component is not destroyed.
    void offer(service_host& host, component& of);

private:
    parameters_response tell(const std::vector<std::string>& names) const;
    parameters_response change(component& of, const std::vector<parameter_setting>& wanted);

    parameter_set set_;
    std::function<void(component&)> changed_;
    std::shared_ptr<const void> keeps_;
    std::function<void(const parameters_response&)> tell_change_; // to subscribers
};

} // namespace ise
