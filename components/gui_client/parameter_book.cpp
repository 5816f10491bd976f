#include <components/gui_client/parameter_book.hpp>

#include <components/boat/parameters.hpp>

#include <algorithm>

namespace atirma::console {
namespace {

std::optional<float> setting(const configuration& result, parameter_id id) {
    switch (id) {
        case parameter_id::time_to_next_tack: return result.time_to_next_tack_s;
        case parameter_id::forbidden_angle_upwind: return result.forbidden_angle_upwind_deg;
        case parameter_id::forbidden_angle_downwind: return result.forbidden_angle_downwind_deg;
        case parameter_id::telemetry_period: return result.telemetry_period_s[static_cast<std::size_t>(link_id::xbee)];
        case parameter_id::leeway_compensation: return result.leeway_compensation;
        case parameter_id::heading_time_limit:
        case parameter_id::fence: break; // their acknowledgements only
    }
    return std::nullopt;
}

} // namespace

parameter_book::parameter_book() {
    for (const auto& info : parameters()) {
        parameter_view one;
        one.id = info.id;
        parameters_.push_back(one);
    }
}

parameter_view* parameter_book::find(parameter_id id) {
    auto found = std::find_if(parameters_.begin(), parameters_.end(), [&](const auto& one) { return one.id == id; });
    return found == parameters_.end() ? nullptr : &*found;
}

void parameter_book::on_settings(const configuration& result, utc_time now) {
    for (auto& one : parameters_) {
        auto value = setting(result, one.id);
        if (!value) continue;
        one.confirmed = value;
        one.confirmed_at = now;
    }
}

void parameter_book::on_asked(std::uint32_t id, const boat_command& command) {
    const auto* set = command.get_if<commands::set_parameter>();
    const auto* get = command.get_if<commands::get_parameter>();
    if (!set && !get) return;
    auto which = set ? set->parameter : get->parameter;
    open_[id] = which;
    auto* one = find(which);
    if (!one) return;
    one->problem.clear();
    if (set) one->pending = set->value;
}

void parameter_book::on_settled(std::uint32_t id, command_phase phase, std::optional<float> value,
                                const std::string& text, utc_time now) {
    auto asked = open_.extract(id);
    if (asked.empty()) return;
    auto which = asked.mapped();
    auto* one = find(which);
    if (!one) return;
    bool another = std::any_of(open_.begin(), open_.end(), [&](const auto& open) { return open.second == which; });
    if (!another) one->pending.reset();
    if (value) {
        one->confirmed = value;
        one->confirmed_at = now;
    }
    one->problem.clear(); // of an older one, which this one has replaced
    if (phase != command_phase::done) one->problem = text.empty() ? std::string(name_of(phase)) : text;
}

} // namespace atirma::console
