#pragma once
#include <ise/core/time.hpp>

namespace ise {

/// How a handle to a role selects a member. Ignored by a handle to a name.
struct role_options {
    /// Whether the handle returns to a member with a higher priority. False: it keeps its member until that is lost.
    bool come_back = true;
    /// How long that member must have been available before the handle returns. This avoids flapping.
    duration steady = std::chrono::seconds(5);

    role_options() = default;
    /// Keeps a member until it is lost.
    static role_options stay() noexcept;
    /// Returns after this time.
    static role_options come_back_after(duration steady) noexcept;
};

} // namespace ise
