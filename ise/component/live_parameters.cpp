#include <ise/component/live_parameters.hpp>

#include <ise/access/guard.hpp>
#include <ise/component/component.hpp>
#include <ise/service/service_host.hpp>
#include <ise/subscription/publication.hpp>

#include <fmt/format.h>

#include <set>
#include <type_traits>

namespace ise {
namespace {

/// Of what somebody asked for, not the program: only a refusal reaches the caller as what it is.
template <class T>
T allowed(result<T> what) {
    if (!what) throw error(errc::refused, what.error().message());
    if constexpr (!std::is_void_v<T>) return *what;
}

// By the access policy.
void may_change(const service_host& host, const std::vector<parameter_setting>& wanted, const verified_peer* by) {
    auto* policy = host.access();
    if (!policy) return;
    for (const auto& [name, value] : wanted) {
        access::request what;
        what.what = access::action::set;
        what.targets = host.titles();
        what.item = name;
        if (auto denied = policy->objection(by, what, host.self().path)) throw error(std::move(*denied));
    }
}

} // namespace

live_parameters::live_parameters(parameter_set set, std::function<void(component&)> changed,
                                 std::shared_ptr<const void> keeps)
    : set_(std::move(set)), changed_(std::move(changed)), keeps_(std::move(keeps)) {}

void live_parameters::offer(service_host& host, component& of) {
    auto add = [&](std::shared_ptr<call_service> service) { host.services().add(std::move(service)).value(); };
    auto changes = make_publication(host, parameter_changes_service);
    host.services().add(changes).value();
    tell_change_ = [out = publication<std::remove_const_t<decltype(parameter_changes_service)>>(changes)](
                       const parameters_response& now) { out(now); };
    add(make_call_service(host, parameters_service,
                          [this](const parameters_request& asked) { return tell(asked.names); }));
    add(make_call_service(host, change_parameters_service,
                          [this, &of, &host](const change_parameters_request& asked, const call_context& context) {
                              may_change(host, asked.settings, context.verified);
                              return change(of, asked.settings);
                          }));
}

parameters_response live_parameters::tell(const std::vector<std::string>& names) const {
    parameters_response made;
    std::set<std::string> wanted;
    for (const auto& name : names) {
        wanted.insert(allowed(set_.known(name))->name);
    }
    for (const auto& one : set_.all())
        if (names.empty() || wanted.contains(one.name)) made.parameters.push_back({one, set_.values(one)});
    return made;
}

parameters_response live_parameters::change(component& of, const std::vector<parameter_setting>& wanted) {
    std::set<std::string> names;
    for (const auto& [name, value] : wanted) {
        allowed(set_.may_change(name, value));
        if (!names.insert(name).second) throw error(errc::refused, fmt::format("parameter '{}' is given twice", name));
    }
    auto before = set_;
    try {
        for (const auto& [name, value] : wanted) allowed(set_.change(name, value));
        if (changed_) changed_(of);
    } catch (...) {
        set_ = before;
        for (const auto& name : names) set_.assign_again(name);
        throw;
    }
    for (const auto& [name, value] : wanted)
        of.log().info("a parameter was changed", {{"name", name}, {"value", value}});
    auto now = tell({names.begin(), names.end()});
    if (tell_change_) tell_change_(now);
    return now;
}

} // namespace ise
