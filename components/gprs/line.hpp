#pragma once
#include <components/boat/telemetry.hpp>

#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

/// The uplink over GPRS: lines as on a serial NMEA bus, README.md. Pure but for uplink_port.
namespace atirma::gprs {

/// No line is longer, its end not counted: a packet of max_packet_size in base64, and what stands around it.
inline constexpr std::size_t max_line = 256;
/// Of a boat's name: letters, digits, '-', '_', '.'.
inline constexpr std::size_t max_id = 32;

/// `$PATL`: who calls, what it still holds, and the last number that it gave. Also sent in between, to be answered.
/// The token tells one life of the boat's program from all others, and from somebody who calls himself so.
struct login {
    std::string id;
    std::uint16_t boot = 0;          ///< of the numbering: another one after each start of the boat's program
    std::uint32_t first_unacked = 1; ///< what lies below is acknowledged or given up
    std::uint32_t last = 0;          ///< first_unacked - 1 where it holds nothing
    std::uint64_t token = 0;         ///< drawn at random at each start of the boat's program
    bool operator==(const login&) const = default;
};
/// `$PATD`: a packet of telemetry, under its number on this link: 1, 2, 3 … of each boot, without gaps.
struct record {
    std::uint16_t boot = 0;
    std::uint32_t number = 1;
    std::int64_t unix_s = 0; ///< when it was measured
    bool history = false;    ///< sent late: never the current position
    ise::bytes raw;          ///< 1 … max_packet_size bytes
    bool operator==(const record&) const = default;
};
/// `$PATA`: all up to this number is safe ashore, the boat may forget it.
struct receipt {
    std::uint16_t boot = 0;
    std::uint32_t number = 0;
    bool operator==(const receipt&) const = default;
};
/// `$PATC`: a telecommand. The same id again is the same telecommand.
struct order {
    std::uint32_t id = 0;
    ise::bytes raw;
    bool operator==(const order&) const = default;
};
/// `$PATR`: how a telecommand ended, and the boat's acknowledgement packet with its words and value.
struct outcome {
    std::uint32_t id = 0;
    std::uint8_t code = 0; ///< an ack_code
    ise::bytes raw;        ///< may be missing
    bool operator==(const outcome&) const = default;
};
/// `$PATN`: over datagrams, the shore's answer to a login from an address that has not shown the address's key.
struct challenge {
    std::uint64_t token = 0; ///< of that login
    std::uint64_t key = 0;   ///< of that address, to be shown from now on
    bool operator==(const challenge&) const = default;
};
/// `$PATK`: the first line of every datagram, either way, but of the login that asks for a key and the challenge.
struct shown_key {
    std::uint64_t key = 0;
    bool operator==(const shown_key&) const = default;
};
using line = std::variant<login, record, receipt, order, outcome, challenge, shown_key>;

/// With checksum, CR and LF. What `parse` would refuse must not be given to it.
std::string encode(const line& of);

/// The line in `text`, which has no CR or LF any more. `malformed` says what is wrong: frame, checksum, fields, ranges.
ise::result<line> parse(std::string_view text);

/// Whether a boat may be called so.
bool is_good_id(std::string_view id) noexcept;

} // namespace atirma::gprs
