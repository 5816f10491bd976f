#pragma once
#include <components/foxglove_gateway/advertisements.hpp>
#include <components/foxglove_gateway/derived_channels.hpp>
#include <components/foxglove_gateway/gateway_context.hpp>
#include <components/foxglove_gateway/viewer_sessions.hpp>

#include <ise/core/task.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/dynamic.hpp>

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace ise::foxglove {

/// The channels that viewers see: of each subscription service its packets, and what the application derives from them;
/// of each action the events of its runs, where the component shows them.
/// Subscribes while a viewer wants a channel. Used on the component's loop.
class shown_channels : public std::enable_shared_from_this<shown_channels> {
public:
    shown_channels(std::shared_ptr<gateway_context> in, std::shared_ptr<viewer_sessions> to)
        : in_(std::move(in)), to_(std::move(to)) {}

    /// `path` provides `service`. Throws ise::error for a type that protobuf cannot have.
    void add(const std::string& path, const dynamic_contract& service);
    /// `path` provides `action` and shows its runs by the service `runs` (`served_runs_service`): their events are a
    /// channel, named as the action. Throws as `add`.
    void add_runs(const std::string& path, const dynamic_contract& action, const dynamic_contract& runs);
    /// Not any more, or with other packets.
    void remove(const std::string& path, const std::string& service);
    /// Tells viewers what was added and removed since the last time.
    void announce();
    bool has(const std::string& path, const std::string& service) const; ///< a channel of that service
    std::size_t size() const noexcept { return channels_.size(); }
    std::shared_ptr<const std::string> list(); ///< the message with all of them, for a new viewer

    void take(const std::shared_ptr<viewer>& who, const subscribe_message& asked);
    void take(const std::shared_ptr<viewer>& who, const unsubscribe_message& asked);
    /// A viewer has gone.
    void leave(viewer& who);
    /// Ends subscriptions that no viewer has wanted for a while.
    void tick();

private:
    struct source;
    struct channel;
    void add_channel(source& from, const derivation::channel& shown);
    void want(const std::shared_ptr<source>& from);
    void stop(source& from);
    static task<> feed(std::shared_ptr<shown_channels> me, std::shared_ptr<source> from);
    void settle(source& from, const std::string& problem);
    void take(source& from, const dynamic_packet& packet, wall_time at);
    void publish(channel& on, wall_time at, std::string payload);
    void detach(viewer::subscription& which);

    std::shared_ptr<gateway_context> in_;
    std::shared_ptr<viewer_sessions> to_;
    std::map<std::pair<std::string, std::string>, std::vector<std::shared_ptr<source>>> sources_; // by path and service
    advertisements<channel*, channel_info> channels_{write_advertise, write_unadvertise};
};

} // namespace ise::foxglove
