#pragma once
#include <components/gui_client/console_state.hpp>
#include <components/gui_client/operator_port.hpp>

#include <ise/component/component.hpp>
#include <ise/naming/services.hpp>

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace atirma::console {

struct gui_client_options {
    std::string space = "atirma";             ///< the namespace whose components are looked at
    std::optional<ise::endpoint> name_server; ///< where proxies are found; nothing: only `proxies` are followed
    std::vector<std::string> proxies;         ///< followed besides what is found: paths or endpoints
    std::string communication = std::string(communication_role); ///< followed as soon as a node of it is found
    ise::duration look_back = std::chrono::hours(12);            ///< so much of the track is asked of the nodes
    state_options state;
    std::shared_ptr<operator_port> port = std::make_shared<operator_port>(); ///< to the windows
    ise::duration tick = std::chrono::milliseconds(200);                     ///< snapshots come at most so often…
    ise::duration max_quiet = std::chrono::milliseconds(600);                ///< …and at least so often
};

/// The operator's console without windows. It follows every component below its namespace that provides `telemetry`,
/// `telecommand` or `telecommand_state` (and `xb_local`), as they come and go; keeps what is known, bounded; carries
/// out what the operator does; publishes snapshots through its port. Nothing that is missing or slow holds it up: a
/// proxy that cannot be reached is waited for and shown as lost.
class gui_client final : public ise::component {
public:
    explicit gui_client(gui_client_options options = gui_client_options());
    ~gui_client() override;

    // On the component's loop.
    const console_state& state() const noexcept { return *state_; }

private:
    struct stream_watch;

    ise::task<> run() override;
    // gui_client_follow.cpp: what comes.
    void follow(const std::string& path, const std::set<std::string>& services);
    ise::task<> follow_telemetry(std::string path);
    ise::task<> follow_commands(std::string path);
    ise::task<> follow_node(std::string path);
    void follow_role();
    ise::task<> follow_record();
    /// The newest value of a subscription, for as long as the component provides it.
    template <class Contract, class Told>
    ise::task<> follow_value(std::string path, Contract service, Told told);
    void watch_streams();
    void publish_snapshot();
    // gui_client_names.cpp: who is there.
    ise::task<> watch_names();
    ise::task<> look_at(std::string path);
    void on_names(const ise::naming::name_events& told);
    void show_present();
    // gui_client_actions.cpp, gui_client_upload.cpp: what the operator does.
    void carry_out();
    void act(give_command what);
    void act(upload_mission what);
    void act(sail_to what);
    void act(change_authority what);
    void act(const remember_alarms& what);
    void act(const set_limits& what);
    void act(cancel_upload);
    void act(set_xbee_parameter what);
    void act(const acknowledge_alarm& what);
    void act(forget_track);
    ise::task<> give(give_command what);
    ise::task<command_phase> execute(give_command what, const bool* stop = nullptr);
    ise::task<> sail(sail_to what);
    ise::task<std::string> get_authority(taking how);
    ise::task<> change(change_authority what);
    ise::task<> upload(upload_mission what);
    ise::task<std::string> upload_points(upload_mission what);
    ise::task<bool> read_back(std::string via, const bool* stop);
    ise::task<> see_what_is_there(std::string via);
    void show_upload(upload_phase phase, std::size_t done, std::size_t total, std::string text);
    ise::task<> set_modem(set_xbee_parameter what);

    utc_time clock() const;
    void news() noexcept { dirty_ = true; }

    gui_client_options options_;
    std::unique_ptr<console_state> state_;
    std::map<std::string, std::set<std::string>> followed_;  ///< by path: the services
    std::map<std::string, std::function<bool()>> connected_; ///< by path: of the telemetry streams that were made
    std::map<std::string, std::string> trouble_;             ///< by path: why there is none
    std::set<std::string> nodes_;
    bool role_followed_ = false;
    track_cursor recorded_; ///< what the nodes have told
    std::map<std::string, present_component> present_;
    /// By path: the incarnation, and how many services it had.
    std::map<std::string, std::pair<std::uint64_t, std::uint32_t>> looked_at_;
    std::function<bool()> names_connected_;
    std::string names_trouble_;
    std::size_t commands_in_hand_ = 0;
    bool uploading_ = false, cancel_upload_ = false;
    std::string upload_trouble_;
    bool dirty_ = false;
    ise::time_point published_{};
};

} // namespace atirma::console
