#pragma once
// Private to this folder: how the rows of a node's store are written, and how they show that the disk changed them.
#include <components/boat/services.hpp>

#include <ise/database/database.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string_view>

namespace atirma::store_rows {

// All that a packet's checksum covers, in its order.
inline constexpr std::string_view packet_sum =
    "row_sum(position, boot, sequence, measured, link, received, history, kind, raw, peer_position)";
// Packets of a program that wrote no checksums have none until `sqlite_store::seal`.
inline constexpr std::string_view packet_is_sound =
    "(sum IS NULL OR sum = row_sum(position, boot, sequence, measured, link, received, history, kind, raw, "
    "peer_position))";
inline constexpr std::string_view command_is_sound = "(sum = row_sum(id, position, open, asked_by, changed, record))";
inline constexpr std::string_view authority_is_sound = "(sum = row_sum(epoch, change, state))";
inline constexpr std::string_view meta_is_sound = "(sum = row_sum(name, value))";
inline constexpr std::string_view life_is_sound = "(sum = row_sum(number, peer, packets, commands))";

/// For `packet_in`.
inline constexpr std::string_view packet_columns =
    "position, boot, sequence, measured, link, received, history, raw, peer_position";

// SQLite's integers have a sign; the bits are the same.
inline std::int64_t cell(std::uint64_t value) { return static_cast<std::int64_t>(value); }
/// Of a bound, which may be above all that SQLite can count.
inline std::int64_t bounded_cell(std::uint64_t value) {
    return cell(std::min(value, static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())));
}
inline std::int64_t cell(utc_time at) { return at.time_since_epoch().count(); }
inline std::uint64_t number_in(const ise::database_row& row, std::size_t column) {
    return static_cast<std::uint64_t>(row.integer(column));
}
inline utc_time time_in(const ise::database_row& row, std::size_t column) {
    return utc_time(std::chrono::milliseconds(row.integer(column)));
}

inline telemetry_packet packet_in(const ise::database_row& row) {
    telemetry_packet made;
    made.position = number_in(row, 0);
    made.boot = static_cast<std::uint16_t>(row.integer(1));
    made.sequence = static_cast<std::uint32_t>(row.integer(2));
    made.measured_at = time_in(row, 3);
    made.link = static_cast<link_id>(row.integer(4));
    made.received_at = time_in(row, 5);
    made.history = row.integer(6) != 0;
    made.raw = row.bytes(7);
    made.peer_position = number_in(row, 8); // 0: it is not known to be there
    return made;
}

inline ise::failure damaged_row(const ise::database& in, std::string_view what) {
    return ise::failure(ise::errc::malformed,
                        fmt::format("{}: {} is damaged: it differs from its checksum", in.file(), what));
}

} // namespace atirma::store_rows
