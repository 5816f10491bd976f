#pragma once
#include <components/gui_client/view.hpp>

#include <optional>
#include <string>
#include <vector>

namespace atirma::console {

// How things are called where people read them.

/// "Auto", "Station".
std::string label(sailing_mode mode);
/// "XBee".
std::string label(link_id link);
/// The link that a proxy's path names: "atirma/shore/xbee" is XBee.
std::optional<link_id> link_of_path(const std::string& path);
/// "XBee" where the link is known, else the end of its path.
std::string label(const link_view& link);
/// "anna": of the operator at atirma/console/anna.
std::string operator_label(const std::string& path);
/// "mode Auto", "insert waypoint 3 at 28.15300, -15.44800", "time to next tack := 30 s": the words of telecommands.hpp.
std::string describe(const boat_command& command);
/// Of another console's command only the kind is known.
std::string describe(command_kind kind);
/// "time to next tack".
std::string label(parameter_id id);
/// 28.15300, -15.44800.
std::string describe(const waypoint& at);

/// What asks for confirmation before it is sent, and why; empty: nothing needs to be asked.
std::string danger(const boat_command& command);

struct packet_field {
    std::string name;
    std::string value; ///< with its unit
};
/// The kind and every field of a packet, or what is wrong with it.
struct packet_text {
    std::string kind; ///< "navigation"; "malformed"
    std::vector<packet_field> fields;
};
packet_text describe(const telemetry_packet& packet);
/// Sixteen bytes a line, with offsets and characters.
std::string hex_dump(ise::bytes_view raw);

} // namespace atirma::console
