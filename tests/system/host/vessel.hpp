#pragma once
#include <ise/ise.hpp>

namespace host_test {

/// How long the answer takes.
struct rest {
    std::uint32_t milliseconds = 0;
};
struct tick {
    std::uint64_t number = 0;
};

inline constexpr ise::request_response<rest, rest> nap{"nap"};
inline constexpr ise::subscription<tick> ticks{"ticks"};

} // namespace host_test
