#include <components/communication_node/record_table.hpp>

#include <components/communication_node/store_rows.hpp>

#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <limits>

namespace atirma {
namespace {

using namespace store_rows;

const std::string record_select = fmt::format("SELECT record, {}, number, position FROM commands ", command_is_sound);
const std::string authority_select =
    fmt::format("SELECT state, {}, change FROM authority ORDER BY epoch DESC ", authority_is_sound);

/// Of a row that has JSON first, and then whether it is sound.
template <class Packet>
Packet packet_of_json(const ise::database& in, const ise::database_row& row, std::string_view what) {
    if (row.integer(1) == 0) throw ise::error(damaged_row(in, what));
    try {
        return ise::from_json<Packet>(row.text(0));
    } catch (const ise::error& unreadable) {
        throw ise::error(ise::errc::malformed,
                         fmt::format("{}: {} is not readable: {}", in.file(), what, unreadable.what()));
    }
}

} // namespace

std::vector<command_record> record_table::records_in(const std::vector<ise::database_row>& rows) const {
    std::vector<command_record> made;
    for (const auto& row : rows) made.push_back(packet_of_json<command_record>(*db_, row, "a telecommand"));
    return made;
}

void record_table::put(const command_record& record, std::uint64_t position) {
    const auto& s = record.status;
    db_->execute("INSERT INTO commands(id, position, open, asked_by, changed, record, sum)"
                 " VALUES(?1, ?2, ?3, ?4, ?5, ?6, row_sum(?1, ?2, ?3, ?4, ?5, ?6))"
                 " ON CONFLICT(id) DO UPDATE SET position = excluded.position, open = excluded.open, asked_by = "
                 "excluded.asked_by, changed = excluded.changed, record = excluded.record, sum = excluded.sum",
                 {std::int64_t{s.id}, cell(position), std::int64_t{!is_final(s.state)}, s.asked_by, cell(s.at),
                  ise::to_json(record)})
        .value();
}

std::optional<command_record> record_table::find(std::uint32_t id) {
    static const auto sql = record_select + "WHERE id = ?";
    auto found = records_in(db_->query(sql, {std::int64_t{id}}).value());
    return found.empty() ? std::nullopt : std::optional(std::move(found.front()));
}

std::vector<command_record> record_table::open() {
    static const auto sql = record_select + "WHERE open = 1 ORDER BY number LIMIT 1000";
    return records_in(db_->query(sql).value());
}

std::pair<std::vector<command_record>, std::uint64_t> record_table::changed(std::uint64_t after, std::size_t most) {
    static const auto sql = record_select + "WHERE position > ? ORDER BY position LIMIT ?";
    auto rows = db_->query(sql, {bounded_cell(after), cell(most)}).value();
    return {records_in(rows), rows.empty() ? after : number_in(rows.back(), 3)};
}

record_page record_table::list(const record_request& request) {
    static const auto all = record_select + "WHERE number < ? ORDER BY number DESC LIMIT ?";
    static const auto of_one = record_select + "WHERE number < ? AND asked_by = ? ORDER BY number DESC LIMIT ?";
    auto before = request.before == 0 ? std::numeric_limits<std::int64_t>::max() : cell(request.before);
    auto most = std::int64_t{request.max_entries} + 1;
    auto rows = request.asked_by.empty() ? db_->query(all, {before, most})
                                         : db_->query(of_one, {before, request.asked_by, most});
    auto found = records_in(rows.value());
    record_page made;
    if (found.size() > request.max_entries) {
        found.pop_back();
        made.before = number_in(rows->at(found.size() - 1), 2);
    }
    for (auto& record : found) made.entries.push_back(std::move(record.status));
    if (request.before != 0) return made;
    static const auto holders = authority_select + "LIMIT 20";
    auto changes = db_->query(holders).value();
    for (const auto& row : changes)
        made.authority.push_back(packet_of_json<authority_state>(*db_, row, "a change of the authority"));
    return made;
}

std::int64_t record_table::prune(std::uint64_t keep) {
    return db_
        ->execute("DELETE FROM commands WHERE number IN (SELECT number FROM commands WHERE open = 0 AND number <= "
                  "(SELECT max(number) FROM commands) - ? ORDER BY number LIMIT 2000)",
                  {cell(keep)})
        .value();
}

void record_table::put(const authority_state& state, std::uint64_t change) {
    db_->execute("INSERT OR REPLACE INTO authority(epoch, change, state, sum) VALUES(?1, ?2, ?3, row_sum(?1, ?2, ?3))",
                 {std::int64_t{state.epoch}, cell(change), ise::to_json(state)})
        .value();
}

std::pair<authority_state, std::uint64_t> record_table::authority() {
    static const auto sql = authority_select + "LIMIT 1";
    auto rows = db_->query(sql).value();
    std::pair<authority_state, std::uint64_t> made;
    if (rows.empty()) return made;
    made.first = packet_of_json<authority_state>(*db_, rows.front(), "the authority");
    made.second = number_in(rows.front(), 2);
    return made;
}

} // namespace atirma
