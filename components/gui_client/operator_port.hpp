#pragma once
#include <components/gui_client/view.hpp>

#include <ise/core/loop.hpp>

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace atirma::console {

/// Whether to take the authority over the boat first, if this console does not have it.
enum class taking : std::uint8_t { no, if_free, from_holder };

/// Sends a telecommand. `via` is the path of a proxy; empty: over the best link, which the communication nodes choose,
/// or without them the console.
struct give_command {
    boat_command command;
    std::string via;
    std::optional<float> valid_s; ///< missing: by kind and link (`default_validity`)
    bool confirmed = false;       ///< the operator has confirmed it, if it is dangerous
    bool over_limits = false;     ///< the operator sends it although a leg crosses land or the fence (leg_check.hpp)
    taking authority = taking::no;
};
/// Puts these in the place of the boat's list, all or nothing, reads the list back and compares. The operator has
/// confirmed it.
struct upload_mission {
    std::vector<waypoint> points;
    std::string via;
    bool over_limits = false; ///< as in give_command
    taking authority = taking::no;
};
/// Inserts a waypoint before the active one and sails to it; the boat then continues with its list.
struct sail_to {
    waypoint point;
    std::string via;
    bool over_limits = false; ///< as in give_command
    taking authority = taking::no;
};
/// Calls a telecommand back, as far as it has not left the shore.
struct call_back_command {
    std::uint32_t id = 0;
};
/// Stops an upload at once. The telecommand in transit may still arrive.
struct cancel_upload {};
/// Takes, requests, hands over or gives up the authority over the boat.
struct change_authority {
    authority_request request;
};
/// Sets a parameter of the modem at a proxy: "power_level", 0 … 4.
struct set_xbee_parameter {
    std::string path;
    std::string name;
    std::uint64_t value = 0;
};
/// Empty: all.
struct acknowledge_alarm {
    std::string key;
};
/// Alarms that were acknowledged before this console was started.
struct remember_alarms {
    std::vector<acknowledged_alarm> before;
};
struct set_limits {
    alarm_limits limits;
};
struct forget_track {};

/// An action of an operator.
using action = std::variant<give_command, upload_mission, cancel_upload, set_xbee_parameter, acknowledge_alarm,
                            forget_track, sail_to, change_authority, remember_alarms, set_limits, call_back_command>;

/// Connects the windows and the component, which run on different threads: snapshots one way, actions the other.
/// Neither side waits for the other. Thread-safe; shared by both, and outlives either.
class operator_port {
public:
    static constexpr std::size_t max_actions = 256; ///< that the component has not taken yet

    /// The newest snapshot; never null.
    std::shared_ptr<const snapshot> latest() const;
    /// Returns false, and does nothing, if the component does not run or its queue is full.
    bool act(action what);
    /// Sets a callback for each new snapshot, on the component's thread: it must return soon, and may call only
    /// `latest()` of the port. Replaces the one before. Once a call with an empty one returns, no callback runs any
    /// more.
    void on_snapshot(std::function<void()> tell);

    // For the component, on its loop.
    void open(std::shared_ptr<ise::loop_gate> gate, std::function<void()> wake);
    void close();
    void publish(std::shared_ptr<const snapshot> made);
    std::vector<action> take();

private:
    mutable std::mutex mutex_;
    std::mutex telling_;
    std::shared_ptr<const snapshot> latest_ = empty();
    std::vector<action> actions_;
    std::shared_ptr<ise::loop_gate> gate_;
    std::shared_ptr<std::function<void()>> wake_; ///< called on the loop only
    std::function<void()> tell_;

    static std::shared_ptr<const snapshot> empty();
};

} // namespace atirma::console
