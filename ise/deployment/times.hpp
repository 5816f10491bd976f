#pragma once
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <string_view>

namespace ise::deployment {

/// "5s", "250ms", "1.5m", "2h"; a bare number means seconds. errc::invalid_argument shows right ones.
result<duration> parse_duration(std::string_view text);

} // namespace ise::deployment
