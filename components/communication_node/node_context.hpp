#pragma once
#include <components/boat/enums.hpp>
#include <components/communication_node/options.hpp>

#include <ise/component/component.hpp>

#include <chrono>

namespace atirma {

/// What all parts of a communication node work with: the component whose coroutines they are, and its options. Parts
/// live on the component's loop.
struct node_context {
    ise::component& self;
    const communication_node_options& options;

    ise::time_point now() const { return self.now(); }
    utc_time clock() const { return std::chrono::floor<std::chrono::milliseconds>(self.wall()); }
    bool has_peer() const noexcept { return !options.peer.empty(); }
};

} // namespace atirma
