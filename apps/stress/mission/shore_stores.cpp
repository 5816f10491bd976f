#include "shore_stores.hpp"

#include <apps/stress/account.hpp>
#include <components/postgres/postgres.hpp>

namespace atirma::stress {
namespace {

ise::result<postgres_rows> rows_of(const std::string& url, const std::string& sql) {
    auto database = postgres_session::open(url);
    if (!database) return database.error();
    return database->query(sql);
}

packet_key key_in(const postgres_row& row) {
    return key_of(static_cast<std::uint16_t>(integer_of(row, 0)), static_cast<std::uint32_t>(integer_of(row, 1)));
}
utc_time time_in(const postgres_row& row, std::size_t column) {
    return utc_time(std::chrono::milliseconds(integer_of(row, column)));
}

} // namespace

ise::result<std::array<std::set<packet_key>, 2>> shore_stores::keys() const {
    std::array<std::set<packet_key>, 2> made;
    if (in_database()) {
        auto rows = rows_of(where_[0], "SELECT boot, sequence FROM atirma.packets");
        if (!rows) return rows.error();
        for (const auto& row : *rows) made[0].insert(key_in(row));
        made[1] = made[0];
        return made;
    }
    for (std::size_t i = 0; i < made.size(); ++i) {
        auto disk = ise::database::open_to_read(where_.at(i));
        if (!disk) return disk.error();
        made[i] = keys_on(*disk);
    }
    return made;
}

std::vector<telemetry_packet> shore_stores::packets() const {
    if (!in_database()) {
        auto disk = ise::database::open_to_read(where_.at(0));
        return packets_on(disk.value());
    }
    auto rows = rows_of(where_[0], "SELECT boot, sequence, measured, link, received, history, raw FROM atirma.packets "
                                   "ORDER BY measured, boot, sequence");
    std::vector<telemetry_packet> made;
    for (const auto& row : rows.value()) {
        auto& one = made.emplace_back();
        one.boot = static_cast<std::uint16_t>(integer_of(row, 0));
        one.sequence = static_cast<std::uint32_t>(integer_of(row, 1));
        one.measured_at = time_in(row, 2);
        one.link = static_cast<link_id>(integer_of(row, 3));
        one.received_at = time_in(row, 4);
        one.history = text_of(row, 5) == "t";
        one.raw = bytes_of_postgres(row.at(6));
    }
    return made;
}

std::set<std::uint32_t> shore_stores::commands() const {
    if (!in_database()) {
        auto disk = ise::database::open_to_read(where_.at(0));
        return commands_on(disk.value());
    }
    std::set<std::uint32_t> made;
    auto rows = rows_of(where_[0], "SELECT id FROM atirma.commands");
    for (const auto& row : rows.value()) made.insert(static_cast<std::uint32_t>(integer_of(row, 0)));
    return made;
}

} // namespace atirma::stress
