#pragma once
#include <components/foxglove_gateway/gateway_context.hpp>
#include <components/foxglove_gateway/shown_channels.hpp>
#include <components/foxglove_gateway/viewer_sessions.hpp>

#include <ise/core/task.hpp>

#include <functional>
#include <memory>
#include <string>
#include <utility>

namespace ise::foxglove {

/// The connection graph, refreshed while a viewer follows it: it describes the components anew. Used on the component's
/// loop.
class shown_graph : public std::enable_shared_from_this<shown_graph> {
public:
    /// `described` gets what a component has answered, and outlives it.
    shown_graph(std::shared_ptr<gateway_context> in, std::shared_ptr<viewer_sessions> to,
                std::shared_ptr<const shown_channels> channels,
                std::function<void(const std::string& path, component_info about)> described)
        : in_(std::move(in)), to_(std::move(to)), channels_(std::move(channels)), described_(std::move(described)) {}

    void take(const std::shared_ptr<viewer>& who, const graph_updates_message& asked);
    /// Draws it anew from time to time.
    void tick();

private:
    static task<> follow(std::shared_ptr<shown_graph> me);
    connection_graph draw() const;

    std::shared_ptr<gateway_context> in_;
    std::shared_ptr<viewer_sessions> to_;
    std::shared_ptr<const shown_channels> channels_;
    std::function<void(const std::string& path, component_info about)> described_;
    connection_graph told_;
    bool drawing_ = false;
    time_point drawn_at_{};
};

} // namespace ise::foxglove
