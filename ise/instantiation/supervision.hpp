#pragma once
#include <ise/core/environment.hpp>
#include <ise/instantiation/services.hpp>
#include <ise/service/back_off.hpp>

#include <deque>
#include <optional>
#include <string>

namespace ise::instantiation {

/// Decides what becomes of one instance; does nothing itself. Each event gives what is to be done now; `next()` is when
/// `tick` wants to be called.
class supervision {
public:
    enum class act : std::uint8_t {
        nothing,
        launch,    ///< then `launched` or `not_launched`
        terminate, ///< SIGTERM to the group
        kill,      ///< SIGKILL to the group
    };

    /// `env` for the jitter only.
    supervision(environment& env, const restart_terms& terms);

    act start(time_point now);
    /// It was started by an instantiation server before this one, and runs.
    void adopt(time_point now, bool was_ready, std::uint32_t restarts);
    /// The same, but it has ended since; `text` is how.
    act adopt_ended(time_point now, std::uint32_t restarts, bool well, const std::string& text);

    /// It was over before this instantiation server started.
    void adopt_over(instance_state state, std::string reason, std::uint32_t restarts);

    /// How it is launched is not known yet: it has until then for that.
    void launch_by(time_point latest);
    void launched(time_point now);
    act not_launched(time_point now, const std::string& why);
    void ready();
    /// Other terms from now on.
    void use(const restart_terms& terms);
    /// `text` is how: "exit code 3".
    act ended(time_point now, bool well, const std::string& text);
    /// It runs, but does not do its work: by its policy it is ended and started again.
    act unhealthy(time_point now, const std::string& why);
    act stop(time_point now, duration grace);
    act kill(time_point now);
    /// How often it was told to stop, or was killed: whoever restarts it looks whether somebody else has since.
    std::uint64_t stops() const noexcept { return stops_; }
    act restart(time_point now);
    act tick(time_point now);
    time_point next() const noexcept { return next_; }

    instance_state state() const noexcept { return state_; }
    /// The reason of its last state change.
    const std::string& reason() const noexcept { return reason_; }
    std::uint32_t restarts() const noexcept { return restarts_; }
    /// Nothing runs, and nothing is going to.
    bool over() const noexcept { return state_ == instance_state::stopped || state_ == instance_state::failed; }
    /// It did not become ready in time.
    bool late() const noexcept { return late_; }

private:
    act begin(time_point now);
    act begin_stop(time_point now, duration grace);
    act again_or_fail(time_point now, const std::string& why);
    void become(instance_state state, std::string reason, time_point next = time_point::max());

    environment& env_;
    restart_terms terms_;
    std::optional<back_off> pause_;
    std::deque<time_point> recent_; // restarts within the window
    instance_state state_ = instance_state::stopped;
    std::string reason_;
    time_point next_ = time_point::max();
    std::uint32_t restarts_ = 0;
    std::uint64_t stops_ = 0;
    bool was_ready_ = false; // ever: before that a failure is whoever started it's
    bool running_ = false;   // a process
    bool launching_ = false;
    bool again_ = false; // after the stop
    bool late_ = false;
    std::string unhealthy_; // why it is being stopped, to be started again by its policy
};

} // namespace ise::instantiation
