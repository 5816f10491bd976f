#pragma once
#include <components/boat/telemetry.hpp>

#include <optional>

namespace atirma {

/// What the boat is told. The fields beside `id`, `sent_at` and `kind` count only for the kinds that name them, and only
/// those travel. Commands are idempotent by `id`: one that arrives twice is done once and acknowledged twice.
struct telecommand {
    std::uint32_t id = 0; ///< chosen by the sender, not reused while the boat may remember it
    command_kind kind = command_kind::ping;
    utc_time sent_at{};
    sailing_mode mode = sailing_mode::manual;                       ///< set_mode
    std::uint8_t index = 0;                                         ///< waypoint_insert (before it), _delete, _select
    waypoint point;                                                 ///< waypoint_add, waypoint_insert
    parameter_id parameter = parameter_id::time_to_next_tack;       ///< set_parameter, get_parameter
    float value = 0;                                                ///< set_parameter, in the unit of parameters.hpp
    link_id link = link_id::xbee;                                   ///< set_telemetry_period
    float period_s = 0;                                             ///< set_telemetry_period; 0 is off
    bool on = true;                                                 ///< emergency_beacon
    std::uint32_t authority = 0; ///< epoch of the operator's authority over the boat; 0: sent without one
    bool operator==(const telecommand&) const = default;
};

/// The boat's answer.
struct acknowledgement {
    static constexpr std::size_t max_text = 60;
    packet_header header;
    std::uint32_t id = 0;
    command_kind kind = command_kind::ping;
    ack_code code = ack_code::done;
    float value = 0;      ///< get_parameter, set_parameter: what holds now; waypoint commands: how many there are
    std::string text;     ///< for people; cut to max_text bytes when encoded
    /// The epoch that the boat obeys; in answers to what came under one, and with no_authority.
    std::optional<std::uint32_t> authority;
    bool operator==(const acknowledgement&) const = default;
};

/// Whether the boat obeys it only under the highest epoch of authority that it has heard. Others ask, and change nothing.
constexpr bool needs_authority(command_kind kind) noexcept {
    using enum command_kind;
    return kind != ping && kind != get_parameter && kind != waypoint_read_back && kind != request_status;
}

/// What must be confirmed by the operator, as it can lose the boat or its mission: reboot, emergency_beacon,
/// waypoint_clear, and set_mode manual.
constexpr bool is_dangerous(command_kind kind, sailing_mode mode) noexcept {
    using enum command_kind;
    return kind == reboot || kind == emergency_beacon || kind == waypoint_clear || (kind == set_mode && mode == sailing_mode::manual);
}

ise::bytes encode_telecommand(const telecommand& command);

/// The command in `raw`, or `malformed` with what is wrong. A kind, mode, parameter or link without a name is kept as a
/// number: the boat answers it with `unknown_command` or `bad_argument`. A position that is not on the globe is refused.
ise::result<telecommand> parse_telecommand(ise::bytes_view raw);

ise::bytes encode_acknowledgement(const acknowledgement& ack);
ise::result<acknowledgement> parse_acknowledgement(ise::bytes_view raw);

/// What a packet is, from its type byte alone.
enum class packet_class : std::uint8_t { unknown, telemetry, telecommand, acknowledgement, receipt };
packet_class classify(ise::bytes_view raw) noexcept;

} // namespace atirma
