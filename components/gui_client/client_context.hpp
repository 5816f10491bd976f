#pragma once
#include <components/gui_client/console_state.hpp>

#include <ise/component/component.hpp>

#include <string>

namespace atirma::console {

/// What the parts of gui_client share: the component on whose loop they run, and the state that they report to.
struct client_context {
    ise::component& self;
    console_state& state;
    std::string role;     ///< the path that all communication nodes serve; empty until one of them was found
    bool changed = false; ///< since the last snapshot

    utc_time clock() const { return std::chrono::floor<std::chrono::milliseconds>(self.wall()); }
    void news() noexcept { changed = true; }
};

} // namespace atirma::console
