#pragma once
#include <components/boat/communication.hpp>
#include <components/boat/heard.hpp>
#include <components/gprs_proxy/services.hpp>
#include <components/gui_client/alarm.hpp>
#include <components/iridium_proxy/services.hpp>
#include <components/xbee_proxy/services.hpp>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

// What the console knows at one instant: plain values, immutable once published, without any window.
namespace atirma::console {

struct boat_view {
    std::optional<heard<location>> position; ///< the last with a fix
    std::optional<heard<navigation>> sailing;
    std::optional<heard<wind>> breeze;
    std::optional<heard<power>> supply;
    std::optional<heard<configuration>> settings;
    std::array<std::optional<heard<link_status>>, link_count> links; ///< as the boat sees them
    std::vector<heard<notice>> notices;                              ///< the last ones, oldest first
    bool has_fix = true;                                             ///< of the newest location
    std::optional<utc_time> last_heard;                              ///< over any link, by the console's clock
};

struct track_point {
    utc_time at{}; ///< measured
    double latitude_deg = 0;
    double longitude_deg = 0;
    float speed_mps = 0;
    link_id link = link_id::xbee;
    bool history = false; ///< told later than it happened
    std::uint16_t boot = 0;
};

/// The list of waypoints that the boat told, as far as it is known.
struct mission_view {
    std::uint16_t revision = 0;
    std::uint8_t active = 0;
    std::size_t count = 0;           ///< of the whole list
    bool complete = false;           ///< all of it is in `points`
    std::vector<waypoint> points;    ///< empty unless complete
    std::optional<utc_time> told_at; ///< when its oldest part arrived; nothing: never heard
};

/// One way to the boat: a component that provides telemetry and takes telecommands.
struct link_view {
    std::string path;                   ///< of the proxy
    bool all_links = false;             ///< the communication nodes' role: all links together
    std::optional<link_id> link;        ///< nothing until a packet tells it, where its name does not
    bool connected = false;             ///< its proxy is reached
    std::string trouble;                ///< why not, or why nothing can be sent
    utc_time since{};                   ///< of `connected`
    std::optional<utc_time> last_heard; ///< the boat, over this link
    std::uint64_t packets = 0;          ///< telemetry, also what came over another link before
    std::uint64_t duplicates = 0;       ///< of these, came over another link before
    std::uint64_t malformed = 0;
    std::uint64_t lost = 0;    ///< published by the proxy, not received here
    std::uint64_t bytes = 0;   ///< of the packets
    std::uint64_t credits = 0; ///< Iridium: one for each 50 bytes begun, of what was heard and sent from here
    std::size_t open_commands = 0;
    bool takes_commands = false;
    std::optional<xbee_local> xbee;
    std::optional<utc_time> xbee_at;
    std::string xbee_answer;                ///< to the last change of its modem's parameters
    std::optional<gprs_state> gprs;         ///< of a GPRS proxy: by which way the boat is there
    std::optional<iridium_account> account; ///< of an Iridium proxy: what it costs
    std::optional<utc_time> told_at;        ///< `gprs` or `account`
};

/// A communication node, as it tells of itself.
struct node_view {
    std::string path;
    bool connected = false;
    std::string trouble; ///< why it is not reached
    std::optional<communication_state> state;
    std::optional<utc_time> told_at;
};

/// Who may tell the boat what to do, as the communication nodes say.
struct authority_view {
    bool known = false; ///< a node has said so
    authority_state state;
    std::string self;      ///< this console's path
    bool changing = false; ///< asked for, not answered yet
    std::string problem;   ///< why the last change did not happen
    bool mine() const noexcept { return known && !self.empty() && state.holder == self; }
};

struct parameter_view {
    parameter_id id{};
    std::optional<float> confirmed; ///< the boat said so
    std::optional<utc_time> confirmed_at;
    std::optional<float> pending; ///< asked for, not answered yet
    std::string problem;          ///< why the last change did not happen
};

enum class command_phase : std::uint8_t {
    asking,  ///< the proxy has not answered yet
    queued,  ///< waits for the link
    sent,    ///< left the shore
    done,    ///< the boat did it
    refused, ///< the boat or the proxy said no
    failed,  ///< cannot be sent
    expired, ///< its time is over: it may have been executed
};
constexpr bool is_over(command_phase phase) noexcept { return phase >= command_phase::done; }
/// "asking", "queued"…
std::string_view name_of(command_phase phase) noexcept;

/// A telecommand of anybody's.
struct command_entry {
    std::uint32_t id = 0;
    std::string path; ///< of the proxy
    std::optional<link_id> link;
    std::string what;     ///< in words; of another console's only the kind
    bool own = false;     ///< given here
    std::string asked_by; ///< the operator's path, where a communication node tells it
    command_phase phase = command_phase::asking;
    std::optional<float> value;
    std::string text;    ///< the last word about it
    utc_time asked_at{}; ///< or first heard of
    utc_time changed_at{};
    std::uint32_t attempts = 0;
};

struct raw_packet {
    std::uint64_t number = 0; ///< counts from 1: gaps show
    std::string path;         ///< of the proxy
    utc_time arrived_at{};
    bool duplicate = false;
    telemetry_packet packet;
};

/// A component of the system, as the name server tells.
struct present_component {
    std::string path;
    std::string type;
    std::string state;
    std::string host;
    std::uint64_t process_id = 0;
    utc_time since{};     ///< seen by this console
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

/// Whether the console finds its way: the name server, or the proxies that it was told.
struct finding_view {
    bool uses_names = true;
    bool reached = false;
    std::string where;       ///< "tcp://…"
    std::string looking_for; ///< "telemetry below atirma"
    std::string trouble;
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
    std::vector<alarm_entry> alarms; ///< the gravest first
    alarm_limits limits;
    // Shared with the snapshots before, as long as nothing has changed.
    std::shared_ptr<const std::vector<track_point>> track;      ///< in the order of time
    std::size_t track_bytes = 0;                                ///< that it takes in memory, here and where it is kept
    std::shared_ptr<const std::vector<command_entry>> commands; ///< oldest first
    std::shared_ptr<const std::vector<std::shared_ptr<const raw_packet>>> packets; ///< oldest first
    std::shared_ptr<const std::vector<present_component>> present;                 ///< by path
};

} // namespace atirma::console
