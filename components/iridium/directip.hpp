#pragma once
#include <components/iridium/message.hpp>

#include <array>
#include <optional>

// DirectIP: one message a TCP connection, big-endian: `01`, u16 length, then elements of `id`, u16 length, content.
namespace atirma::iridium {

inline constexpr std::size_t directip_prefix = 3;       ///< revision and overall length
inline constexpr std::size_t max_directip_bytes = 2048; ///< of a whole message that is accepted
inline constexpr std::size_t max_directip_payload = 1960;

/// How long the message whose first bytes these are is as a whole; nothing until `directip_prefix` bytes are there.
/// Errors: malformed (another revision), too_large.
ise::result<std::optional<std::size_t>> directip_length(ise::bytes_view begin);

/// An MO message, whole. Unknown elements are skipped; the header is required. Errors: malformed, with what and where.
ise::result<mo_message> parse_directip_mo(ise::bytes_view whole);
ise::bytes encode_directip_mo(const mo_message& what);

/// What the receiver of an MO message answers.
ise::bytes encode_mo_confirmation(bool success);
ise::result<bool> parse_mo_confirmation(ise::bytes_view whole);

enum mt_flag : std::uint16_t {
    flush_queue = 1,
    send_ring_alert = 2,
    update_location = 8,
    high_priority = 16,
    assign_mtmsn = 32
};

struct directip_mt {
    std::uint32_t client_id = 0;
    std::array<std::byte, 15> imei{}; ///< as it travels; digits where somebody sane sends it
    std::uint16_t flags = 0;
    ise::bytes payload;
    bool operator==(const directip_mt&) const = default;
};
std::array<std::byte, 15> imei_bytes(std::string_view imei) noexcept; ///< of 15 digits
std::string imei_text(const std::array<std::byte, 15>& raw);

/// Errors: malformed.
ise::result<directip_mt> parse_directip_mt(ise::bytes_view whole);
ise::bytes encode_directip_mt(const directip_mt& what);

struct mt_confirmation {
    std::uint32_t client_id = 0;
    std::array<std::byte, 15> imei{};
    std::uint32_t auto_id = 0; ///< of the gateway
    std::int16_t status = 0;   ///< 1 … 50 place in the queue, 0 no payload, below: what went wrong
    bool operator==(const mt_confirmation&) const = default;
};
ise::result<mt_confirmation> parse_mt_confirmation(ise::bytes_view whole);
ise::bytes encode_mt_confirmation(const mt_confirmation& what);
/// "-5": "the queue of the modem is full".
std::string_view explain_mt_status(int status) noexcept;
/// Whether the same message may be taken later without anybody doing anything.
bool mt_status_passes(int status) noexcept;

} // namespace atirma::iridium
