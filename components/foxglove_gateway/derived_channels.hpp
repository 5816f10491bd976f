#pragma once
#include <components/foxglove_gateway/protocol.hpp>
#include <components/foxglove_gateway/viewer.hpp>

#include <ise/packet/dynamic.hpp>
#include <ise/service/dynamic.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

/// Channels that an application derives from its own services, such as well-known schemas that viewers show without
/// settings. The gateway knows nothing of applications: they pass it a `derivation_maker`.
namespace ise::foxglove {

/// A message of a derived channel.
struct derived_message {
    std::size_t channel = 0; ///< its place in `derivation::channels()`
    wall_time at{};
    std::string payload;
};

/// Channels made of the packets of one service of one component. Used on the gateway's loop.
class derivation {
public:
    /// A channel as viewers see it.
    struct channel {
        std::string topic;
        schema_info schema;
        channel_kind kind = channel_kind::state;
    };
    virtual ~derivation() = default;

    /// Constant. Topics should begin with the path of the component.
    virtual const std::vector<channel>& channels() const = 0;
    /// Whether it listens also while no viewer does, because it keeps a history.
    virtual bool always() const { return false; }
    /// Takes a packet that came at `at` (its publication), and appends what is to be sent. What it throws is counted,
    /// and the packet is left out.
    virtual void take(const dynamic_packet& packet, wall_time at, std::vector<derived_message>& to) = 0;
};

/// The derivation of a subscription service that a component provides; null: there is none.
using derivation_maker =
    std::function<std::unique_ptr<derivation>(const std::string& component, const dynamic_contract& service)>;

} // namespace ise::foxglove
