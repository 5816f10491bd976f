#pragma once
#include <ise/core/loop.hpp>
#include <ise/service/link.hpp>
#include <ise/service/role_choice.hpp>

namespace ise {

/// What a link to a role has beside one to a name.
struct link::role_state {
    role_state(link& owner, role_options how);

    /// The session with the member that was taken has ended.
    void on_loss(session& ended, const failure& cause);

    loop& on;
    role_choice choice;
    timer due; // to move
};

} // namespace ise
