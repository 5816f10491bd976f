#include <components/gui_client/words.hpp>

#include <components/boat/parameters.hpp>
#include <components/gui_client/track_store.hpp>

#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma::console {
namespace {

std::string spaced(std::string_view name) {
    std::string made(name);
    std::replace(made.begin(), made.end(), '_', ' ');
    return made;
}

class field_list {
public:
    void add(std::string name, std::string value) { all.push_back({std::move(name), std::move(value)}); }
    void number(std::string name, double value, int digits, std::string_view unit) {
        add(std::move(name), fmt::format("{:.{}f}{}{}", value, digits, unit.empty() ? "" : " ", unit));
    }
    void flag(std::string name, bool value) { add(std::move(name), value ? "yes" : "no"); }
    std::vector<packet_field> all;
};

void fields(field_list& to, const location& p) {
    to.number("latitude", p.latitude_deg, 7, "°");
    to.number("longitude", p.longitude_deg, 7, "°");
    to.add("fix", spaced(name_of(p.quality)));
    to.add("satellites", fmt::format("{}", p.satellites));
    to.number("speed over ground", static_cast<double>(p.speed_over_ground_mps), 2, "m/s");
    to.number("course over ground", static_cast<double>(p.course_over_ground_deg), 2, "°");
    to.number("distance sailed", static_cast<double>(p.distance_sailed_m), 1, "m");
}
void fields(field_list& to, const navigation& p) {
    to.add("mode", spaced(name_of(p.mode)));
    to.add("tack", spaced(name_of(p.on)));
    to.flag("in irons", p.in_irons);
    to.flag("remote control", p.remote_control);
    to.flag("beacon", p.beacon);
    to.flag("turned back at its fence", p.at_fence);
    to.number("heading", static_cast<double>(p.heading_deg), 2, "°");
    to.number("heel", static_cast<double>(p.heel_deg), 1, "°");
    to.number("pitch", static_cast<double>(p.pitch_deg), 1, "°");
    to.number("rudder commanded", static_cast<double>(p.rudder_commanded_deg), 1, "°");
    to.number("rudder measured", static_cast<double>(p.rudder_measured_deg), 1, "°");
    to.number("sheet allows", static_cast<double>(p.sail_commanded_deg), 1, "°");
    to.number("boom measured", static_cast<double>(p.sail_measured_deg), 1, "°");
    to.add("waypoint",
           p.waypoint_count ? fmt::format("{} of {}", p.waypoint_index + 1, p.waypoint_count) : std::string("none"));
    to.number("distance to waypoint", static_cast<double>(p.distance_to_waypoint_m), 1, "m");
    to.number("bearing to waypoint", static_cast<double>(p.bearing_to_waypoint_deg), 2, "°");
    to.number("course to steer", static_cast<double>(p.course_to_steer_deg), 2, "°");
    to.number("cross-track error", static_cast<double>(p.cross_track_error_m), 1, "m");
    to.add("laps", fmt::format("{}", p.laps));
}
void fields(field_list& to, const wind& p) {
    to.number("apparent angle", static_cast<double>(p.apparent_angle_deg), 2, "°");
    to.number("apparent speed", static_cast<double>(p.apparent_speed_mps), 2, "m/s");
    to.number("true direction", static_cast<double>(p.true_direction_deg), 2, "°");
    to.number("true speed", static_cast<double>(p.true_speed_mps), 2, "m/s");
}
void fields(field_list& to, const power& p) {
    to.number("battery", static_cast<double>(p.battery_v), 3, "V");
    to.number("current", static_cast<double>(p.battery_a), 3, "A");
    to.add("charge", fmt::format("{} %", p.battery_percent));
    to.number("hull temperature", static_cast<double>(p.temperature_c), 1, "°C");
    to.add("uptime", fmt::format("{} s", p.uptime_s));
    to.add("last reset", spaced(name_of(p.last_reset)));
    to.add("faults", fmt::format("{:04X}", p.faults));
}
void fields(field_list& to, const waypoints& p) {
    to.add("revision", fmt::format("{}", p.revision));
    to.add("count", fmt::format("{}", p.count));
    to.add("active", p.count ? fmt::format("{}", p.active + 1) : std::string("none"));
    for (std::size_t i = 0; i < p.entries.size(); ++i)
        to.add(fmt::format("waypoint {}", p.first + i + 1), describe(p.entries[i]));
}
void fields(field_list& to, const configuration& p) {
    to.add("revision", fmt::format("{}", p.revision));
    to.number("time to next tack", static_cast<double>(p.time_to_next_tack_s), 1, "s");
    to.number("forbidden angle upwind", static_cast<double>(p.forbidden_angle_upwind_deg), 1, "°");
    to.number("forbidden angle downwind", static_cast<double>(p.forbidden_angle_downwind_deg), 1, "°");
    to.number("leeway compensation", static_cast<double>(p.leeway_compensation), 2, "");
    for (std::size_t i = 0; i < link_count; ++i)
        to.add("period over " + label(static_cast<link_id>(i)),
               p.telemetry_period_s[i] > 0 ? fmt::format("{:g} s", p.telemetry_period_s[i]) : std::string("off"));
}
void fields(field_list& to, const link_status& p) {
    to.add("link", label(p.link));
    to.flag("up", p.up);
    to.add("RSSI", p.rssi_dbm ? fmt::format("{} dBm", p.rssi_dbm) : std::string("unknown"));
    to.add("queued", fmt::format("{}", p.queued));
    to.add("sent", fmt::format("{}", p.sent));
    to.add("failed", fmt::format("{}", p.failed));
    to.add("dropped", fmt::format("{}", p.dropped));
    to.number("shore last heard", static_cast<double>(p.last_heard_age_s), 1, "s ago");
}
void fields(field_list& to, const notice& p) { to.add("text", p.text); }

} // namespace

std::string_view name_of(command_phase phase) noexcept {
    static constexpr std::array<std::string_view, 8> names{"asking",  "queued", "sent",    "done",
                                                           "refused", "failed", "expired", "too late"};
    return names[static_cast<std::size_t>(phase) % names.size()];
}

std::string label(sailing_mode mode) {
    switch (mode) {
        case sailing_mode::manual: return "Manual";
        case sailing_mode::hold: return "Heading";
        case sailing_mode::automatic: return "Auto";
        case sailing_mode::return_home: return "RTL";
        case sailing_mode::station_keep: return "Loiter";
    }
    return fmt::format("mode {}", static_cast<int>(mode));
}

std::string label(link_id link) {
    switch (link) {
        case link_id::xbee: return "XBee";
        case link_id::gprs: return "GPRS";
        case link_id::iridium: return "Iridium";
    }
    return fmt::format("link {}", static_cast<int>(link));
}

std::optional<link_id> link_of_path(const std::string& path) {
    return from_name<link_id>(path.substr(path.rfind('/') + 1));
}

std::string operator_label(const std::string& path) { return path.substr(path.rfind('/') + 1); }

std::string label(const link_view& link) {
    if (link.all_links) return "All links";
    if (link.link) return label(*link.link);
    return link.path.substr(link.path.rfind('/') + 1);
}

std::string label(parameter_id id) { return spaced(name_of(id)); }

std::string bytes_text(std::uint64_t bytes) {
    auto number = static_cast<double>(bytes);
    if (bytes < 10'000) return fmt::format("{} B", bytes);
    return bytes < 1'000'000 ? fmt::format("{:.1f} kB", number / 1e3) : fmt::format("{:.1f} MB", number / 1e6);
}

std::string describe(const waypoint& at) { return fmt::format("{:.5f}, {:.5f}", at.latitude_deg, at.longitude_deg); }

std::string describe(command_kind kind) { return spaced(name_of(kind)); }

namespace {

template <class T>
std::string argument_words(const T& value, const std::optional<argument_range>& range) {
    if constexpr (std::is_same_v<T, waypoint>) return describe(value);
    else if constexpr (std::is_same_v<T, std::string>) return value;
    else if constexpr (std::is_same_v<T, bool>) return value ? "on" : "off";
    else if constexpr (requires { label(value); }) return label(value);
    else if constexpr (std::is_enum_v<T>) return spaced(name_of(value));
    else if constexpr (std::is_integral_v<T>) return fmt::format("{}", value);
    else if (range && range->zero_is_off && value == 0) return "off";
    else return fmt::format("{:g}{}{}", value, range && !range->unit.empty() ? " " : "", range ? range->unit : "");
}

/// `words` with the values of its {argument}s.
std::string filled_in(const boat_command& command, std::string_view words) {
    std::string made(words);
    auto put = [&made](const std::string& place, const std::string& said) {
        if (auto at = made.find(place); at != std::string::npos) made.replace(at, place.size(), said);
    };
    command.for_each_argument([&](std::string_view name, const auto& value) {
        put(fmt::format("{{{}}}", name), argument_words(value, range_of(command, name)));
        if constexpr (std::is_integral_v<std::remove_cvref_t<decltype(value)>>)
            put(fmt::format("{{{}+1}}", name), fmt::format("{}", value + 1));
    });
    return made;
}

} // namespace

std::string describe(const boat_command& command) {
    auto words = traits_of(command.kind()).words;
    return words.empty() ? describe(command.kind()) : filled_in(command, words);
}

std::string danger(const boat_command& command) {
    auto why = command.danger();
    return filled_in(command, why.empty() ? command.caution() : why);
}

packet_text describe(const telemetry_packet& packet) {
    packet_text made;
    field_list list;
    list.add("link", label(packet.link) + (packet.history ? ", history" : ""));
    list.add("boot, sequence", fmt::format("{}{}, {}", packet.boot,
                                           packet.boot == beacon_boot ? " (second controller)" : "", packet.sequence));
    list.add("measured", ise::iso_8601(packet.measured_at, 3));
    list.add("received", ise::iso_8601(packet.received_at, 3));
    auto message = parse_telemetry(packet.raw);
    if (!message) {
        made.kind = "malformed";
        list.add("problem", message.error().message());
    } else {
        made.kind = spaced(name_of(message->body));
        std::visit([&](const auto& body) { fields(list, body); }, message->body);
    }
    made.fields = std::move(list.all);
    return made;
}

std::string hex_dump(ise::bytes_view raw) {
    std::string text;
    for (std::size_t at = 0; at < raw.size(); at += 16) {
        std::string hex, letters;
        for (std::size_t i = at; i < at + 16; ++i) {
            if (i % 8 == 0) hex += ' ';
            if (i >= raw.size()) {
                hex += "   ";
                continue;
            }
            auto byte = std::to_integer<unsigned>(raw[i]);
            hex += fmt::format("{:02X} ", byte);
            letters += byte >= 0x20 && byte < 0x7F ? static_cast<char>(byte) : '.';
        }
        text += fmt::format("{:04X} {} {}\n", at, hex, letters);
    }
    return text;
}

} // namespace atirma::console
