#pragma once
#include <components/mqtt_bridge/bridge_context.hpp>
#include <components/mqtt_bridge/outgoing_messages.hpp>

#include <ise/core/task.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/dynamic.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace ise::mqtt {

/// The subscription services that the bridge sends to the broker: it subscribes to each, again after every failure, and
/// hands their packets to `outgoing_messages`. Used on the component's loop.
class service_feeds : public std::enable_shared_from_this<service_feeds> {
public:
    service_feeds(std::shared_ptr<bridge_context> in, std::shared_ptr<outgoing_messages> to)
        : in_(std::move(in)), to_(std::move(to)) {}

    /// `path` provides `service`. Throws ise::error for a type that protobuf cannot have.
    void add(const std::string& path, const dynamic_contract& service);
    /// Not any more, or with other packets.
    void remove(const std::string& path, const std::string& service);
    std::uint32_t topics() const noexcept { return static_cast<std::uint32_t>(all_.size()); } ///< now

private:
    struct source;
    static task<> feed(std::shared_ptr<service_feeds> me, std::shared_ptr<source> from);
    void take(const source& from, const dynamic_packet& packet, wall_time at);
    void gap(const source& of, std::optional<std::uint64_t> lost);
    void settle(source& of, const std::string& problem);

    std::shared_ptr<bridge_context> in_;
    std::shared_ptr<outgoing_messages> to_;
    std::map<std::pair<std::string, std::string>, std::shared_ptr<source>> all_; // by path and service
};

} // namespace ise::mqtt
