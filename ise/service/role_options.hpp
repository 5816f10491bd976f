#pragma once
#include <ise/core/time.hpp>

namespace ise {

/// How a handle to a role chooses among those who serve it. A handle to a name does not look at it.
struct role_options {
    /// To a better member once it is there (again). False: it stays with the present one until that is lost.
    bool come_back = true;
    /// For so long the better one must have been there, so that one that comes and goes is not followed.
    duration steady = std::chrono::seconds(5);

    role_options() = default;
    static role_options stay() noexcept;
    static role_options come_back_after(duration steady) noexcept;
};

} // namespace ise
