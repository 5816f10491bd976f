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
    /// Its name in a database of many boats: the first part of the role, or of the path ("boat-2").
    std::string boat() const {
        const auto& name = options.role.empty() ? self.path() : options.role;
        return name.substr(0, name.find('/'));
    }
    bool has_peer() const noexcept { return !options.peer.empty(); }
};

} // namespace atirma
