#pragma once
#include <components/boat/boat_command.hpp>
#include <components/boat/telemetry.hpp>

#include <optional>

namespace atirma {

/// What the boat is told. It is idempotent by `id`: a telecommand that arrives twice is executed once and acknowledged
/// twice.
struct telecommand {
    /// The limit of `valid_for`, 24 bits of hundredths of a second: 46 hours.
    static constexpr std::chrono::milliseconds max_valid_for{0xFFFFFF * 10};

    std::uint32_t id = 0; ///< chosen by the sender, not reused while the boat may remember it
    utc_time sent_at{};   ///< by the clock that `clock_of` names
    boat_command command;
    std::uint32_t authority = 0; ///< epoch of the operator's authority over the boat; 0: sent without one
    /// The boat does not execute it later than this after `sent_at`; rounded down to hundredths of a second. Nothing:
    /// of an older shore, which set no limit.
    std::optional<std::chrono::milliseconds> valid_for;
    /// 0: `sent_at` is UTC. Else the boot of the boat whose clock it is given by (boat_clock.hpp).
    std::uint16_t clock_of = 0;
    bool operator==(const telecommand&) const = default;
};

/// The boat's answer.
struct acknowledgement {
    static constexpr std::size_t max_text = 60;
    packet_header header;
    std::uint32_t id = 0;
    command_kind kind = command_kind::ping;
    ack_code code = ack_code::done;
    /// What holds now, of a telecommand that returns a value: the parameter, the period, how many waypoints.
    float value = 0;
    std::string text; ///< for people; cut to max_text bytes when encoded
    /// The epoch that the boat obeys; in answers to what came under one, and with no_authority.
    std::optional<std::uint32_t> authority;
    bool operator==(const acknowledgement&) const = default;
};

/// "06:32:10Z".
std::string utc_text(utc_time at);

ise::bytes encode_telecommand(const telecommand& command);

/// The command in `raw`, or `malformed` with what is wrong. An enumerator without a name is kept as a number, and a
/// kind as `commands::unknown`: the boat answers `bad_argument` or `unknown_command`. A position that is not on the
/// globe is refused.
ise::result<telecommand> parse_telecommand(ise::bytes_view raw);

ise::bytes encode_acknowledgement(const acknowledgement& ack);
ise::result<acknowledgement> parse_acknowledgement(ise::bytes_view raw);

/// What a packet is, from its type byte alone.
enum class packet_class : std::uint8_t { unknown, telemetry, telecommand, acknowledgement, receipt };
packet_class classify(ise::bytes_view raw) noexcept;

} // namespace atirma
