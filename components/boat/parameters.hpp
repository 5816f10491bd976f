#pragma once
#include <components/boat/enums.hpp>

#include <ise/core/result.hpp>

namespace atirma {

/// A parameter that the operator may change.
struct parameter_info {
    parameter_id id;
    std::string_view unit;
    std::string_view meaning;
    float minimum;
    float maximum;
    float initial;
};

std::span<const parameter_info> parameters() noexcept;

/// Nothing where the number has no name.
const parameter_info* find_parameter(parameter_id id) noexcept;

/// `bad` values are refused as `invalid_argument` with the range in the text.
ise::result<void> check_parameter(parameter_id id, float value);

} // namespace atirma
