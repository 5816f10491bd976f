#pragma once
#include <components/xbee/framing.hpp>

#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

namespace atirma::xbee {

inline constexpr std::uint64_t broadcast_address = 0x000000000000FFFF;
inline constexpr std::uint16_t unknown_network = 0xFFFE;
/// TX option of the 868: drop rather than wait for duty cycle.
inline constexpr std::uint8_t option_purge_if_delayed = 0x10;

/// Two letters, such as {'D', 'B'}.
using at_name = std::array<char, 2>;
constexpr at_name at(std::string_view letters) { return {letters[0], letters[1]}; }
inline std::string_view text(const at_name& name) { return {name.data(), name.size()}; }

enum class at_status : std::uint8_t { ok = 0, error = 1, bad_command = 2, bad_parameter = 3, tx_failure = 4 };

/// How a transmission ended (frame 8B). Values not listed are kept as numbers.
enum class delivery : std::uint8_t {
    success = 0x00,
    no_ack = 0x01,
    cca_failure = 0x02,
    purged = 0x03,
    invalid_endpoint = 0x15,
    network_ack_failure = 0x21,
    not_joined = 0x22,
    self_addressed = 0x23,
    address_not_found = 0x24,
    route_not_found = 0x25,
    resource_error = 0x32,
    payload_too_large = 0x74,
};

/// "no_ack"; "unknown" for a value that this version does not know.
std::string_view name_of(delivery code) noexcept;
std::string_view name_of(at_status code) noexcept;

/// Types 08 and 09 (queued until AC or the next 08). Frame id 0 asks for no answer, here and below.
struct at_request {
    std::uint8_t frame_id = 0;
    at_name command{};
    ise::bytes parameter;
    bool queued = false;
    bool operator==(const at_request&) const = default;
};

/// Type 88.
struct at_response {
    std::uint8_t frame_id = 0;
    at_name command{};
    at_status status = at_status::ok;
    ise::bytes value;
    bool operator==(const at_response&) const = default;
};

/// Type 10.
struct transmit_request {
    std::uint8_t frame_id = 0;
    std::uint64_t destination = 0;
    std::uint16_t network = unknown_network;
    std::uint8_t radius = 0;
    std::uint8_t options = 0;
    ise::bytes payload;
    bool operator==(const transmit_request&) const = default;
};

/// Type 8B.
struct transmit_status {
    std::uint8_t frame_id = 0;
    std::uint16_t network = unknown_network;
    std::uint8_t retries = 0;
    delivery outcome = delivery::success;
    std::uint8_t discovery = 0;
    bool operator==(const transmit_status&) const = default;
};

/// Type 90.
struct received_packet {
    std::uint64_t source = 0;
    std::uint16_t network = unknown_network;
    std::uint8_t options = 0;
    ise::bytes payload;
    bool operator==(const received_packet&) const = default;
};

/// Type 17. Option bit 0x02: apply at once.
struct remote_at_request {
    std::uint8_t frame_id = 0;
    std::uint64_t destination = 0;
    std::uint16_t network = unknown_network;
    std::uint8_t options = 0;
    at_name command{};
    ise::bytes parameter;
    bool operator==(const remote_at_request&) const = default;
};

/// Type 97.
struct remote_at_response {
    std::uint8_t frame_id = 0;
    std::uint64_t source = 0;
    std::uint16_t network = unknown_network;
    at_name command{};
    at_status status = at_status::ok;
    ise::bytes value;
    bool operator==(const remote_at_response&) const = default;
};

/// Type 8A.
struct modem_status {
    std::uint8_t status = 0; ///< 0 hardware reset, 1 watchdog reset, 6 coordinator started …
    bool operator==(const modem_status&) const = default;
};

/// Any other type, as it came.
struct raw_frame {
    std::uint8_t type = 0;
    ise::bytes body;
    bool operator==(const raw_frame&) const = default;
};

using frame = std::variant<at_request, at_response, transmit_request, transmit_status, received_packet,
                           remote_at_request, remote_at_response, modem_status, raw_frame>;

/// A refusal with its text. Never throws; a hostile frame costs no more than its own bytes.
struct refused {
    refusal reason = refusal::truncated;
    std::string message;
};
using parsed_frame = std::variant<frame, refused>;

/// The type byte of a frame.
std::uint8_t type_of(const frame& f) noexcept;

/// The fields of a frame's data (type byte first, unescaped, without length and checksum).
/// Fixed fields must be there; what a longer 8A or 8B carries beyond them is ignored.
parsed_frame parse_frame_data(ise::bytes_view data);

/// Exactly one frame as on the wire, delimiter to checksum.
parsed_frame parse_frame(ise::bytes_view wire, api_mode mode);

/// Frame data of `f`: type byte and fields.
ise::bytes frame_data(const frame& f);

/// A frame as on the wire. Throws `ise::error` (too_large) if its data are above `max_frame_data`.
ise::bytes encode(const frame& f, api_mode mode);

} // namespace atirma::xbee
