#include <components/boat/parameters.hpp>

#include <fmt/format.h>

#include <array>
#include <cmath>

namespace atirma {

std::span<const parameter_info> parameters() noexcept {
    static constexpr std::array<parameter_info, parameter_count> table{{
        {parameter_id::time_to_next_tack, "s", "shortest time between two tacks while beating", 0, 3600, 0},
        {parameter_id::forbidden_angle_upwind, "deg", "closest angle to the wind that the boat is asked to sail", 30,
         85, 60},
        {parameter_id::forbidden_angle_downwind, "deg", "closest angle to dead downwind; 0 lets it run", 0, 60, 0},
        {parameter_id::telemetry_period, "s", "period of location and navigation on the radio link", 0.5f, 3600, 2},
        {parameter_id::leeway_compensation, "1", "part of the measured leeway that the course allows for", 0, 1, 0},
        {parameter_id::heading_time_limit, "s",
         "a heading, or Manual without a remote control, is kept so long; then the boat loiters", 60, 86400, 900},
        {parameter_id::fence, "1", "1: the boat turns back at its fence and at the coast; 0: it does not", 0, 1, 1},
    }};
    return table;
}

const parameter_info* find_parameter(parameter_id id) noexcept {
    for (auto& info : parameters())
        if (info.id == id) return &info;
    return nullptr;
}

ise::result<void> check_parameter(parameter_id id, float value) {
    auto* info = find_parameter(id);
    if (!info)
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("no parameter has number {}", static_cast<int>(id)));
    if (!std::isfinite(value) || value < info->minimum || value > info->maximum)
        return ise::failure(ise::errc::invalid_argument, fmt::format("{} is {:g} to {:g} {}, not {:g}", name_of(id),
                                                                     info->minimum, info->maximum, info->unit, value));
    return {};
}

} // namespace atirma
