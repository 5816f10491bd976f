#pragma once
#include <components/gui_client/view.hpp>

#include <ise/core/loop.hpp>

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <variant>
#include <vector>

namespace atirma::console {

/// Whether the authority over the boat is taken first, where this console does not have it.
enum class taking : std::uint8_t { no, if_free, from_holder };

/// Sends a telecommand. `via` is the path of a proxy; empty: over the best link, which the communication nodes choose,
/// or the console where there are none.
struct give_command {
    boat_command command;
    std::string via;
    float valid_s = 300;
    bool confirmed = false; ///< the operator was asked, where it is dangerous
    taking authority = taking::no;
};
/// Clears the boat's list, adds these, reads the list back and compares. The operator was asked.
struct upload_mission {
    std::vector<waypoint> points;
    std::string via;
    taking authority = taking::no;
};
/// Puts a waypoint before the active one and sails to it; the list goes on after it.
struct sail_to {
    waypoint point;
    std::string via;
    taking authority = taking::no;
};
/// Stops an upload at once. The telecommand that is under way may still arrive.
struct cancel_upload {};
/// Takes the authority over the boat, asks for it, hands it over, gives it up.
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
/// That were acknowledged before this console was started.
struct remember_alarms {
    std::vector<acknowledged_alarm> before;
};
struct set_limits {
    alarm_limits limits;
};
struct forget_track {};

/// What an operator does.
using action = std::variant<give_command, upload_mission, cancel_upload, set_xbee_parameter, acknowledge_alarm,
                            forget_track, sail_to, change_authority, remember_alarms, set_limits>;

/// What lies between windows and the component, which live on threads of their own: snapshots one way, actions the
/// other. Neither side waits for the other. Thread-safe; shared by both, and outlives either.
class operator_port {
public:
    static constexpr std::size_t max_actions = 256; ///< that nobody has taken yet

    /// The newest snapshot; never null.
    std::shared_ptr<const snapshot> latest() const;
    /// False, and nothing happens, where the component does not run or is too far behind.
    bool act(action what);
    /// Called for each new snapshot on the component's thread: it must return soon, and not call back into the port
    /// but for `latest()`. Replaces the one before; an empty one ends it, and once that returns none runs any more.
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
    std::shared_ptr<std::function<void()>> wake_; ///< looked at on the loop only
    std::function<void()> tell_;

    static std::shared_ptr<const snapshot> empty();
};

} // namespace atirma::console
