#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <optional>
#include <string_view>

namespace ise::detail {

/// "50" microseconds, as ISE_POLL_US and --poll give them. errc::invalid_argument.
result<duration> parse_poll_window(std::string_view microseconds);

/// What a node was given, else what its environment says, else zero. Throws errc::invalid_argument.
duration poll_window_of(const std::optional<duration>& given, const environment& env);

} // namespace ise::detail
