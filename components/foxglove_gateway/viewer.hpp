#pragma once
#include <components/foxglove_gateway/protocol.hpp>

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

namespace ise::foxglove {

/// A message of a channel on its way to viewers, which share it.
struct channel_message {
    wall_time at{}; ///< of its publication
    std::string payload;
};

/// How a message of a channel relates to the one before it that a viewer has not taken yet.
enum class channel_kind : std::uint8_t {
    state, ///< replaces it: the newest `depth` are kept
    events ///< comes beside it: up to `max_events` are kept
};

/// What one viewer can cost.
struct viewer_limits {
    std::uint32_t depth = 1;         ///< messages of each channel of state that wait; the newest are kept
    std::uint32_t max_events = 1024; ///< messages of each channel of events that wait; the newest are kept
    std::size_t max_waiting_bytes = std::size_t{8} << 20; ///< of messages that wait; beyond, the oldest are skipped
    std::size_t max_control_bytes = std::size_t{4} << 20; ///< of everything else that waits; beyond, it is closed
    std::size_t max_subscriptions = 4096;                 ///< at once
    std::size_t max_channels = 256;                       ///< of its own
    std::size_t max_parameters = 4096;                    ///< names that it follows
    std::size_t max_operations = 32;                      ///< calls and requests that are being answered
    std::size_t max_assets = 64;                          ///< that were asked for and not sent
};

/// What waits for one viewer, and what it has asked for. Pure: no I/O, no clock. A viewer that takes nothing keeps the
/// newest messages of each channel, as many as its kind says.
class viewer {
public:
    /// One subscription; `waiting` is the viewer's own business.
    struct subscription {
        viewer* of = nullptr;
        std::uint32_t id = 0, channel = 0;
        std::uint32_t depth = 1; ///< messages that wait at most
        std::deque<std::shared_ptr<const channel_message>> waiting;
        bool listed = false;
    };

    /// `wake`: something waits to be sent.
    viewer(viewer_limits limits, std::function<void()> wake);
    viewer(const viewer&) = delete;
    viewer& operator=(const viewer&) = delete;

    // Everything but messages of channels: sent first, in order, never skipped.
    void text(std::string message);
    void binary(std::string message);
    void text(std::shared_ptr<const std::string> message); ///< shared by viewers
    /// The first messages, which do not count: they are as long as the system is large.
    void greet(std::shared_ptr<const std::string> message);
    /// Replaces one that has not been sent.
    void clock(std::string message);
    /// More waits than it may.
    bool overrun() const noexcept { return control_bytes_ > limits_.max_control_bytes; }
    /// Nothing but messages of channels waits.
    bool idle() const noexcept { return control_.empty(); }

    /// errc::invalid_argument for an id that is in use or a channel that has a subscription; errc::overloaded.
    result<subscription*> subscribe(std::uint32_t id, std::uint32_t channel, channel_kind kind = channel_kind::state);
    subscription* find(std::uint32_t id) noexcept; ///< by id; null: there is none
    void unsubscribe(std::uint32_t id) noexcept;   ///< what waits for it is not sent
    const std::map<std::uint32_t, std::unique_ptr<subscription>>& subscriptions() const noexcept { return all_; }

    /// A message for one of its subscriptions.
    void offer(subscription& to, std::shared_ptr<const channel_message> message);
    /// Appends what is to be sent next, as WebSocket frames: about 64 KiB, and at least one message where one waits.
    void fill(std::string& to);

    std::uint64_t sent() const noexcept { return sent_; }       ///< messages of channels
    std::uint64_t skipped() const noexcept { return skipped_; } ///< pushed out by newer ones before they were sent

    // What it has asked for; looked after by the gateway.
    std::map<std::uint32_t, advertise_message::entry> channels;
    std::set<std::string> parameters;
    bool all_parameters = false;
    bool graph = false;
    std::size_t operations = 0;
    std::deque<fetch_asset_message> assets;
    bool fetching = false;
    bool gone = false;
    std::uint64_t told_skipped = 0;
    const viewer_limits& limits() const noexcept { return limits_; }

private:
    struct frame {
        bool is_text = true;
        std::shared_ptr<const std::string> content;
        std::size_t counted = 0;
    };
    void put(frame one);
    void skip_oldest();

    viewer_limits limits_;
    std::function<void()> wake_;
    std::deque<frame> control_;
    std::size_t control_bytes_ = 0;
    std::optional<std::string> time_;
    std::map<std::uint32_t, std::unique_ptr<subscription>> all_;
    std::map<std::uint32_t, std::uint32_t> by_channel_;
    std::deque<subscription*> ready_; // with something that waits, served in turn
    std::size_t waiting_bytes_ = 0;
    std::uint64_t sent_ = 0, skipped_ = 0;
};

} // namespace ise::foxglove
