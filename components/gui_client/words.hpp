#pragma once
#include <components/gui_client/view.hpp>

#include <optional>
#include <string>
#include <vector>

namespace atirma::console {

// Labels and descriptions for operators.

/// The names that operators of other autopilots expect: "Manual", "Heading", "Auto", "RTL", "Loiter".
std::string label(sailing_mode mode);
/// "XBee".
std::string label(link_id link);
/// The link that a proxy's path names: XBee for "atirma/shore/xbee".
std::optional<link_id> link_of_path(const std::string& path);
/// "XBee" where the link is known, else the end of its path.
std::string label(const link_view& link);
/// The operator's name: "anna" for atirma/console/anna.
std::string operator_label(const std::string& path);
/// "mode Auto", "insert waypoint 3 at 28.15300, -15.44800", "time to next tack := 30 s": the words of telecommands.hpp.
std::string describe(const boat_command& command);
/// For a command of another console, of which only the kind is known.
std::string describe(command_kind kind);
/// "time to next tack".
std::string label(parameter_id id);
/// 28.15300, -15.44800.
std::string describe(const waypoint& at);
/// "980 B", "12.5 kB", "3.1 MB".
std::string bytes_text(std::uint64_t bytes);

/// Why the operator must confirm this command before it is sent; empty: no confirmation is needed.
std::string danger(const boat_command& command);

struct packet_field {
    std::string name;
    std::string value; ///< with its unit
};
/// The kind and every field of a packet, or its error.
struct packet_text {
    std::string kind; ///< "navigation"; "malformed"
    std::vector<packet_field> fields;
};
packet_text describe(const telemetry_packet& packet);
/// Sixteen bytes a line, with offsets and characters.
std::string hex_dump(ise::bytes_view raw);

} // namespace atirma::console
