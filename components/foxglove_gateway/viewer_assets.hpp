#pragma once
#include <components/foxglove_gateway/gateway_context.hpp>
#include <components/foxglove_gateway/viewer.hpp>

#include <ise/core/task.hpp>

#include <memory>
#include <utility>

namespace ise::foxglove {

/// The files that viewers fetch (`assets`): of each viewer one after the other. Used on the component's loop.
class viewer_assets {
public:
    explicit viewer_assets(std::shared_ptr<gateway_context> in) : in_(std::move(in)) {}

    void take(const std::shared_ptr<viewer>& who, fetch_asset_message& asked);

private:
    static task<> fetch(std::shared_ptr<gateway_context> in, std::shared_ptr<viewer> who);

    std::shared_ptr<gateway_context> in_;
};

} // namespace ise::foxglove
