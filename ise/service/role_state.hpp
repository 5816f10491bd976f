#pragma once
#include <ise/core/loop.hpp>
#include <ise/service/role_choice.hpp>

#include <functional>

namespace ise {

/// What a link to a role has beside one to a name.
struct role_state {
    /// `move`: it is time to go to a better member.
    role_state(loop& on, role_options how, std::function<void()> move) : choice(how), due(on, std::move(move)) {}

    role_choice choice;
    timer due; // to move
};

} // namespace ise
