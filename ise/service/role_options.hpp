#pragma once
#include <ise/core/time.hpp>

namespace ise {

/// How a handle to a role chooses among its members. A handle to a name ignores it.
struct role_options {
    /// Whether the handle returns to a better member. False: it stays with the present one until that is lost.
    bool failback = true;
    /// How long the better member must have been available, so that the handle does not follow an unstable one.
    duration failback_delay = std::chrono::seconds(5);

    role_options() = default;
    static role_options no_failback() noexcept;
    static role_options failback_after(duration failback_delay) noexcept;
};

} // namespace ise
