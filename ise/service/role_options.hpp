#pragma once
#include <ise/core/time.hpp>

namespace ise {

/// How a handle to a role chooses among its members. A handle to a name ignores it.
struct role_options {
    /// Whether the handle returns to a better member. False: it stays with the present one until that is lost.
    bool come_back = true;
    /// How long the better member must have been available, so that the handle does not follow an unstable one.
    duration steady = std::chrono::seconds(5);

    role_options() = default;
    static role_options stay() noexcept;
    static role_options come_back_after(duration steady) noexcept;
};

} // namespace ise
