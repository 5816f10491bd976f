#pragma once
#include <components/boat/duplicate_filter.hpp>
#include <components/gui_client/alarm.hpp>
#include <components/gui_client/alarm_bell.hpp>
#include <components/gui_client/boat_record.hpp>
#include <components/gui_client/command_log.hpp>
#include <components/gui_client/course_watch.hpp>
#include <components/gui_client/mission.hpp>
#include <components/gui_client/packet_log.hpp>
#include <components/gui_client/parameter_book.hpp>
#include <components/gui_client/track_store.hpp>
#include <components/gui_client/view.hpp>

#include <map>
#include <memory>
#include <optional>

namespace atirma::console {

struct state_options {
    alarm_limits limits;
    std::size_t max_track = 20000;
    std::size_t max_packets = 500;
    std::size_t max_notices = 50;
    std::size_t max_commands = 300;
    std::size_t max_links = 32;                                       ///< the number of proxies that are followed
    std::shared_ptr<const sea_limits> sea = sea_limits::coast_only(); ///< coast and fence; null: none
};

/// The complete state of the console, without I/O: it is given events with the console's time, and makes snapshots.
/// Bounded. Not thread-safe.
class console_state {
public:
    explicit console_state(state_options options = state_options());

    // Events of the system.
    void on_telemetry(const std::string& path, const telemetry_packet& packet, utc_time now);
    void on_status(const std::string& path, const telecommand_status& status, utc_time now);
    void on_xbee(const std::string& path, const xbee_local& local, utc_time now);
    void on_xbee_answer(const std::string& path, std::string text);
    void on_gprs(const std::string& path, const gprs_state& result, utc_time now);
    void on_account(const std::string& path, const iridium_account& account, utc_time now);
    void on_lost(const std::string& path, std::uint64_t packets);
    /// A proxy is followed from now on. False: there are `max_links` already.
    bool add_link(const std::string& path) { return link_at(path) != nullptr; }
    /// A proxy is reached, or not and why.
    void on_link(const std::string& path, bool connected, std::string trouble, utc_time now);
    void takes_commands(const std::string& path);
    /// `path` is the role of the communication nodes: its packets came over any link, at any time in the past.
    void stands_for_all(const std::string& path);
    /// A communication node reports its state; `result` null: only whether it is reached.
    void on_node(const std::string& path, bool connected, std::string trouble, const communication_state* result,
                 utc_time now);
    void on_authority(const authority_state& result, utc_time now);
    void on_finding(finding_view finding) { finding_ = std::move(finding); }
    void on_present(std::vector<present_component> all);

    // Actions of the operator.
    void asked(std::uint32_t id, const std::string& path, const boat_command& command, utc_time now,
               std::optional<utc_time> valid_until = std::nullopt);
    void on_executed(std::uint32_t id, utc_time at) { commands_.on_executed(id, at); }
    /// The boat has executed a set_mode.
    void on_mode_set(utc_time at) { boat_.on_mode_set(at); }
    void on_called_back(std::uint32_t id, std::string text) { commands_.on_called_back(id, std::move(text)); }
    void on_outcome(std::uint32_t id, command_phase phase, std::optional<float> value, std::string text, utc_time now);
    /// A change of the authority was requested, or is decided; `problem`: why it was refused.
    void asks_authority(bool under_way, std::string problem);
    void set_self(std::string path) { authority_.self = std::move(path); }
    void set_limits(const alarm_limits& limits) { options_.limits = limits; }
    void remember(const std::vector<acknowledged_alarm>& before, utc_time until) { alarms_.remember(before, until); }
    void on_upload(upload_view upload) { upload_ = std::move(upload); }
    void acknowledge(const std::string& key, utc_time now = utc_time()) { alarms_.acknowledge(key, now); }
    /// An alarm could not be sent by mail or to the web hook, or could be again (an empty `trouble`).
    void on_outlet(const std::string& key, const std::string& trouble, utc_time now) {
        alarms_.set(key, !trouble.empty(), severity::warning, trouble, now);
    }
    void clear_track() { track_.clear(); }

    /// Applies the rules of the alarms, which depend on the time, and calls the operator. True: it called.
    bool on_time(utc_time now);
    /// What happened to the alarms since the last call of this.
    std::vector<alarm_event> take_alarm_events();
    const sea_limits* sea() const noexcept { return options_.sea.get(); }
    std::shared_ptr<const snapshot> view(utc_time now);

    const boat_view& boat() const noexcept { return boat_.view(); }
    const mission_parts& mission() const noexcept { return mission_; }
    const command_log& commands() const noexcept { return commands_; }
    const std::map<std::string, link_view>& links() const noexcept { return links_; }
    const upload_view& upload() const noexcept { return upload_; }
    const authority_view& authority() const noexcept { return authority_; }

private:
    link_view* link_at(const std::string& path);
    void count(link_view& link, const telemetry_packet& packet, bool first, utc_time now);
    void count_recorded(link_view& role, const telemetry_packet& packet, utc_time now);
    /// `kept`: it is old, and comes from the nodes' record.
    void take(const telemetry_message& message, const telemetry_packet& packet, utc_time now, bool kept);
    void take_authority(const authority_state& result, utc_time now);
    void watch_authority(utc_time now);
    void watch_requests(utc_time now);
    bool has_gone(const std::string& console) const;

    state_options options_;
    finding_view finding_;
    boat_record boat_;
    mission_parts mission_;
    upload_view upload_;
    parameter_book parameters_;
    std::map<std::string, link_view> links_;
    std::map<std::string, node_view> nodes_;
    authority_view authority_;
    /// One with an epoch below the known one, and since when only such ones come.
    struct lower_authority {
        authority_state state;
        utc_time since{};
    };
    std::optional<lower_authority> lower_;
    std::map<std::string, duplicate_filter> heard_over_; ///< by path: a packet is counted once on each link
    duplicate_filter seen_;
    alarm_book alarms_;
    alarm_bell bell_;
    bell_view last_call_;
    course_watch course_;
    std::uint64_t events_taken_ = 0;
    track_store track_;
    command_log commands_;
    packet_log packets_;
    std::shared_ptr<const std::vector<present_component>> present_;
    std::uint64_t snapshot_count_ = 0;
};

} // namespace atirma::console
