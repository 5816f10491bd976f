#pragma once
// Private to this folder: rows of a store in PostgreSQL.
#include <components/communication_node/services.hpp>
#include <components/postgres/postgres.hpp>

#include <ise/core/error.hpp>
#include <ise/packet/json.hpp>

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace atirma::postgres_rows_of {

/// For `packet_in`.
inline constexpr std::string_view columns_of_packet =
    "position, boot, sequence, measured, link, received, history, raw";
inline constexpr std::string_view authority_query =
    "SELECT state, change FROM atirma.authority WHERE boat = $1 ORDER BY epoch DESC LIMIT 1";

inline std::uint64_t number_of(const postgres_row& row, std::size_t column) {
    return static_cast<std::uint64_t>(integer_of(row, column));
}
inline utc_time time_of(const postgres_row& row, std::size_t column) {
    return utc_time(std::chrono::milliseconds(integer_of(row, column)));
}

telemetry_packet packet_in(const postgres_row& row, std::size_t from = 0);
/// Throw ise::error for what is not readable.
std::vector<command_record> records_in(const postgres_rows& rows);
std::optional<std::pair<authority_state, std::uint64_t>> authority_in(const postgres_rows& rows);

template <class Packet>
std::optional<Packet> read_json(const std::string& text) {
    try {
        return ise::from_json<Packet>(text);
    } catch (const ise::error&) {
        return std::nullopt;
    }
}

std::vector<std::string> lines_of(const std::string& text);

/// Which of two records of a telecommand is the more complete one, before their times (knows_more).
int weight_of(const command_record& record);

/// Columns of packets, each as an array for a statement.
struct packet_arrays {
    explicit packet_arrays(std::span<const telemetry_packet> packets);
    std::string boots, sequences, times, links, receptions, histories, contents;
};
struct command_arrays {
    explicit command_arrays(std::span<const command_record> records);
    std::string ids, opens, askers, weights, changes, givers, contents;
};

/// Errors: io_failed for an older version, which a migration helps; invalid_argument for a newer one.
ise::result<void> check_version(const std::string& database, const postgres_rows& found);

} // namespace atirma::postgres_rows_of
