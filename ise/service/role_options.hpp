#pragma once
#include <ise/core/time.hpp>

namespace ise {

/// How a handle to a role selects a member. Ignored by a handle to a name.
struct role_options {
    /// Whether the handle returns to a member with a higher priority. False: it keeps its member until that is lost.
    bool failback = true;
    /// How long that member must have been available before the handle returns. This avoids flapping.
    duration failback_delay = std::chrono::seconds(5);

    role_options() = default;
    /// Keeps a member until it is lost.
    static role_options no_failback() noexcept;
    /// Returns after this time.
    static role_options failback_after(duration failback_delay) noexcept;
};

} // namespace ise
