#pragma once
#include <components/gui_client/alarm_outlets.hpp>
#include <components/gui_client/console_state.hpp>
#include <components/gui_client/operator_port.hpp>

#include <ise/component/component.hpp>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace atirma::console {

struct gui_client_options {
    std::string space = "atirma";            ///< the namespace whose components are looked at
    std::vector<ise::endpoint> name_servers; ///< where proxies are found; nothing: only `proxies` are followed
    std::vector<std::string> proxies;        ///< followed besides what is found: paths or endpoints
    std::string communication = std::string(communication_role); ///< followed as soon as a node of it is found
    ise::duration look_back = std::chrono::hours(12);            ///< so much of the track is asked of the nodes
    state_options state;
    alarm_outlet_options outlets;                                            ///< mail and web hook for alarms
    std::shared_ptr<operator_port> port = std::make_shared<operator_port>(); ///< to the windows
    ise::duration tick = std::chrono::milliseconds(200);                     ///< snapshots come at most so often…
    ise::duration max_quiet = std::chrono::milliseconds(600);                ///< …and at least so often
};

/// The operator's console without windows. It follows every component below its namespace that provides `telemetry`,
/// `telecommand` or `telecommand_state` (and `xb_local`), as they come and go; keeps a bounded state; executes the
/// operator's actions; publishes snapshots through its port. A missing or slow component delays nothing: a proxy that
/// cannot be reached is retried and shown as lost.
class gui_client final : public ise::component {
public:
    explicit gui_client(gui_client_options options = gui_client_options());
    ~gui_client() override;

    /// On the component's loop.
    const console_state& state() const noexcept;

private:
    struct parts;

    ise::task<> run() override;
    void publish_snapshot();

    gui_client_options options_;
    std::unique_ptr<parts> parts_; ///< made anew by each start
    ise::time_point published_{};
};

} // namespace atirma::console
