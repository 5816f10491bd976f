#include <components/boat/enums.hpp>

#include <array>

namespace atirma {

template <>
std::span<const enum_name<sailing_mode>> names_of() noexcept {
    using enum sailing_mode;
    static constexpr std::array<enum_name<sailing_mode>, 5> names{{
        {"manual", manual},
        {"hold", hold},
        {"automatic", automatic},
        {"return_home", return_home},
        {"station_keep", station_keep},
    }};
    return names;
}

template <>
std::span<const enum_name<link_id>> names_of() noexcept {
    using enum link_id;
    static constexpr std::array<enum_name<link_id>, 3> names{{
        {"xbee", xbee},
        {"gprs", gprs},
        {"iridium", iridium},
    }};
    return names;
}

template <>
std::span<const enum_name<tack>> names_of() noexcept {
    using enum tack;
    static constexpr std::array<enum_name<tack>, 3> names{{
        {"none", none},
        {"port", port},
        {"starboard", starboard},
    }};
    return names;
}

template <>
std::span<const enum_name<fix_quality>> names_of() noexcept {
    using enum fix_quality;
    static constexpr std::array<enum_name<fix_quality>, 4> names{{
        {"none", none},
        {"gps", gps},
        {"differential", differential},
        {"simulated", simulated},
    }};
    return names;
}

template <>
std::span<const enum_name<reset_cause>> names_of() noexcept {
    using enum reset_cause;
    static constexpr std::array<enum_name<reset_cause>, 4> names{{
        {"power_on", power_on},
        {"commanded", commanded},
        {"watchdog", watchdog},
        {"brown_out", brown_out},
    }};
    return names;
}

template <>
std::span<const enum_name<parameter_id>> names_of() noexcept {
    using enum parameter_id;
    static constexpr std::array<enum_name<parameter_id>, 5> names{{
        {"time_to_next_tack", time_to_next_tack},
        {"forbidden_angle_upwind", forbidden_angle_upwind},
        {"forbidden_angle_downwind", forbidden_angle_downwind},
        {"telemetry_period", telemetry_period},
        {"leeway_compensation", leeway_compensation},
    }};
    return names;
}

template <>
std::span<const enum_name<command_kind>> names_of() noexcept {
    using enum command_kind;
    static constexpr std::array<enum_name<command_kind>, 16> names{{
        {"ping", ping},
        {"set_mode", set_mode},
        {"waypoint_add", waypoint_add},
        {"waypoint_insert", waypoint_insert},
        {"waypoint_delete", waypoint_delete},
        {"waypoint_clear", waypoint_clear},
        {"waypoint_read_back", waypoint_read_back},
        {"waypoint_select", waypoint_select},
        {"set_parameter", set_parameter},
        {"get_parameter", get_parameter},
        {"tack_now", tack_now},
        {"gybe_now", gybe_now},
        {"set_telemetry_period", set_telemetry_period},
        {"request_status", request_status},
        {"reboot", reboot},
        {"emergency_beacon", emergency_beacon},
    }};
    return names;
}

template <>
std::span<const enum_name<ack_code>> names_of() noexcept {
    using enum ack_code;
    static constexpr std::array<enum_name<ack_code>, 5> names{{
        {"done", done},
        {"refused", refused},
        {"bad_argument", bad_argument},
        {"unknown_command", unknown_command},
        {"no_authority", no_authority},
    }};
    return names;
}

} // namespace atirma
