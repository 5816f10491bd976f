#pragma once
#include <components/boat/communication.hpp>
#include <components/boat/heard.hpp>
#include <components/boat/report_rhythm.hpp>
#include <components/coast/sea_limits.hpp>
#include <components/gprs_proxy/services.hpp>
#include <components/gui_client/alarm.hpp>
#include <components/iridium_proxy/services.hpp>
#include <components/xbee_proxy/services.hpp>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

// The state of the console at one instant: plain values, immutable once published, independent of windows.
namespace atirma::console {

struct boat_view {
    std::optional<heard<location>> position; ///< the last one with a fix
    std::optional<heard<navigation>> sailing;
    std::optional<heard<wind>> breeze;
    std::optional<heard<power>> supply;
    std::optional<heard<configuration>> settings;
    std::array<std::optional<heard<link_status>>, link_count> links; ///< as the boat sees them
    std::optional<heard<notice>> beacon;                             ///< the newest words of the second controller
    std::vector<heard<notice>> notices;                              ///< the last ones, oldest first
    bool has_fix = true;                                             ///< of the newest location
    std::optional<utc_time> last_heard;                              ///< over any link, by the console's clock
    report_rhythm rhythm;                                            ///< how often it reports over each link
    /// The newest position is the second controller's: the main one or its power fails.
    bool on_beacon() const noexcept { return position && position->boot == beacon_boot; }
    /// When the present mode was set, renewed, or got the helm back from the remote control; measured where no
    /// telecommand says it: the first report of the mode that came here.
    std::optional<utc_time> mode_since;
};

struct track_point {
    utc_time at{}; ///< measured
    double latitude_deg = 0;
    double longitude_deg = 0;
    float speed_mps = 0;
    link_id link = link_id::xbee;
    bool history = false; ///< reported later than measured
    std::uint16_t boot = 0;
};

/// The list of waypoints that the boat reported, as far as it is known.
struct mission_view {
    std::uint16_t revision = 0;
    std::uint8_t active = 0;
    std::size_t count = 0;           ///< of the whole list
    bool complete = false;           ///< all of it is in `points`
    std::vector<waypoint> points;    ///< empty unless complete
    std::optional<utc_time> told_at; ///< when its oldest part arrived; empty: never
};

/// One link to the boat: a component that provides telemetry and accepts telecommands.
struct link_view {
    std::string path;                   ///< of the proxy
    bool all_links = false;             ///< the communication nodes' role: all links together
    std::optional<link_id> link;        ///< by its path, else by its first packet; empty until then
    bool connected = false;             ///< its proxy is reached
    std::string trouble;                ///< why not, or why nothing can be sent
    utc_time since{};                   ///< of `connected`
    std::optional<utc_time> last_heard; ///< the boat, over this link
    std::uint64_t packets = 0;          ///< telemetry, including duplicates
    std::uint64_t duplicates = 0;       ///< of these, received over another link before
    std::uint64_t malformed = 0;
    std::uint64_t lost = 0;    ///< published by the proxy, not received here
    std::uint64_t bytes = 0;   ///< of the packets
    std::uint64_t credits = 0; ///< Iridium: one for each 50 bytes begun, received and sent here
    std::size_t open_commands = 0;
    bool takes_commands = false;
    std::optional<xbee_local> xbee;
    std::optional<utc_time> xbee_at;
    std::string xbee_answer;                ///< to the last change of its modem's parameters
    std::optional<gprs_state> gprs;         ///< of a GPRS proxy: how the boat is connected
    std::optional<iridium_account> account; ///< of an Iridium proxy: its costs
    std::optional<utc_time> told_at;        ///< of `gprs` or `account`
    /// What it may cost, by its proxy's report: Iridium in credits, GPRS in bytes.
    link_budget budget() const {
        if (gprs) return gprs->budget;
        if (!account) return {};
        return {account->daily_budget, account->budget_left, account->monthly_budget, account->monthly_budget_left};
    }
    /// How it is sealed, by its proxy's report; null: it has not told.
    const link_seal* seal() const noexcept {
        return xbee ? &xbee->seal : gprs ? &gprs->seal : account ? &account->seal : nullptr;
    }
};

/// A communication node, by its own report.
struct node_view {
    std::string path;
    bool connected = false;
    std::string trouble; ///< why it is not reached
    std::optional<communication_state> state;
    std::optional<utc_time> told_at;
};

/// Which operator may send telecommands, according to the communication nodes.
struct authority_view {
    bool known = false; ///< a node has reported it
    authority_state state;
    std::string self;      ///< this console's path
    bool changing = false; ///< requested, not answered yet
    std::string problem;   ///< why the last change did not happen
    bool mine() const noexcept { return known && !self.empty() && state.holder == self; }
};

struct parameter_view {
    parameter_id id{};
    std::optional<float> confirmed; ///< by the boat
    std::optional<utc_time> confirmed_at;
    std::optional<float> pending; ///< requested, not answered yet
    std::string problem;          ///< why the last change did not happen
};

enum class command_phase : std::uint8_t {
    asking,  ///< the proxy has not answered yet
    queued,  ///< waiting for the link
    sent,    ///< left the shore
    done,    ///< executed by the boat
    refused, ///< by the boat or the proxy
    failed,  ///< cannot be sent
    expired, ///< not decided in time: it may have been executed
    late,    ///< not executed: it reached the boat after its validity
};
constexpr bool is_over(command_phase phase) noexcept { return phase >= command_phase::done; }
/// "asking", "queued"…
std::string_view name_of(command_phase phase) noexcept;

/// A telecommand of any operator.
struct command_entry {
    std::uint32_t id = 0;
    std::string path; ///< of the proxy
    std::optional<link_id> link;
    std::string what;     ///< in words; for another console's only the kind
    bool own = false;     ///< given here
    std::string asked_by; ///< the operator's path, if a communication node reports it
    std::string asked_as; ///< the operator's verified identity, by the communication node; empty: not verified
    command_phase phase = command_phase::asking;
    std::optional<float> value;
    std::string text;    ///< the newest report about it
    utc_time asked_at{}; ///< or first reported
    utc_time changed_at{};
    std::uint32_t attempts = 0;
    std::optional<utc_time> valid_until; ///< the boat does not execute it later
    std::optional<utc_time> executed_at; ///< by the boat's answer
    std::string called_back;             ///< what became of calling it back; empty: nobody did
    /// Whether it may be called back: it has not left the shore, as far as is known.
    bool may_be_called_back() const noexcept { return phase <= command_phase::queued; }
};

struct raw_packet {
    std::uint64_t number = 0; ///< counts from 1: gaps show
    std::string path;         ///< of the proxy
    utc_time arrived_at{};
    bool duplicate = false;
    telemetry_packet packet;
};

/// A component of the system, according to the name server.
struct present_component {
    std::string path;
    std::string type;
    std::string state;
    std::string host;
    std::uint64_t process_id = 0;
    utc_time since{};     ///< first seen by this console
    bool console = false; ///< another operator, or this one
    bool self = false;
};

enum class upload_phase : std::uint8_t { none, sending, reading_back, verified, differs, failed, cancelled };
constexpr bool is_running(upload_phase phase) noexcept {
    return phase == upload_phase::sending || phase == upload_phase::reading_back;
}
struct upload_view {
    upload_phase phase = upload_phase::none;
    std::size_t done = 0; ///< waypoints that the boat has acknowledged
    std::size_t total = 0;
    std::string text; ///< for people
    utc_time at{};    ///< of the last change
};

/// How proxies are found: by the name server, or by configuration.
struct finding_view {
    bool uses_names = true;
    bool reached = false;
    std::string where;       ///< "tcp://…"
    std::string looking_for; ///< "telemetry below atirma"
    std::string trouble;
};

/// The last call of an alarm to the operator: a sound and a window alert.
struct bell_view {
    std::uint64_t count = 0; ///< grows with each call
    severity how = severity::notice;
    std::string text;
};

struct snapshot {
    std::uint64_t number = 0;
    utc_time at{};
    finding_view finding;
    boat_view boat;
    mission_view mission;
    upload_view upload;
    std::vector<parameter_view> parameters; ///< in the order of their numbers
    std::vector<link_view> links;           ///< by path
    std::vector<node_view> nodes;           ///< by path
    authority_view authority;
    std::vector<alarm_entry> alarms; ///< the most severe first
    alarm_limits limits;
    bell_view bell;
    std::shared_ptr<const sea_limits> sea; ///< coast and fence; null: none
    // Shared with earlier snapshots as long as nothing has changed.
    std::shared_ptr<const std::vector<track_point>> track;      ///< in the order of time
    std::size_t track_bytes = 0;                                ///< its memory, here and in the store
    std::shared_ptr<const std::vector<command_entry>> commands; ///< oldest first
    std::shared_ptr<const std::vector<std::shared_ptr<const raw_packet>>> packets; ///< oldest first
    std::shared_ptr<const std::vector<present_component>> present;                 ///< by path
    std::shared_ptr<const std::vector<alarm_event>> alarm_log;                     ///< oldest first
};

} // namespace atirma::console
