#include <components/communication_node/packet_table.hpp>

#include <components/boat/newest_by_kind.hpp>
#include <components/communication_node/store_rows.hpp>

#include <fmt/format.h>

#include <limits>

namespace atirma {
namespace {

using namespace store_rows;

const std::string packet_select = fmt::format("SELECT {}, {} FROM packets ", packet_columns, packet_is_sound);

/// Another position at the other node; the checksum follows.
std::string sets_at_peer(std::string_view to, std::string_view where) {
    return fmt::format("UPDATE packets SET peer_position = {0}, sum = iif(sum IS NULL, NULL, row_sum(position, boot, "
                       "sequence, measured, link, received, history, kind, raw, {0})) WHERE {1} AND {2}",
                       to, where, packet_is_sound);
}

} // namespace

void packet_table::damaged(std::uint64_t position) const {
    throw ise::error(damaged_row(*db_, fmt::format("packet {}", position)));
}

// Another content under its numbers is another packet, so that a forged one does not take the place of the boat's own.
packet_table::place packet_table::put(const telemetry_packet& p, std::uint64_t position, std::uint64_t at_peer) {
    auto kind = p.raw.size() > 1 ? std::to_integer<std::int64_t>(p.raw[1]) : 0;
    ise::database_value there;
    if (at_peer != 0) there = cell(at_peer);
    auto fresh = db_->execute(
        "INSERT OR IGNORE INTO packets(position, boot, sequence, measured, link, received, history, kind, raw, "
        "peer_position, sum) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, "
        "row_sum(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10))",
        {cell(position), std::int64_t{p.boot}, std::int64_t{p.sequence}, cell(p.measured_at),
         static_cast<std::int64_t>(p.link), cell(p.received_at), std::int64_t{p.history}, kind, p.raw, there});
    place made;
    made.position = position;
    made.fresh = fresh.value() > 0;
    if (made.fresh) return made;
    static const auto sql =
        fmt::format("SELECT position, {} FROM packets WHERE boot = ? AND sequence = ? AND measured = ? AND raw = ?",
                    packet_is_sound);
    auto known = db_->query(sql, {std::int64_t{p.boot}, std::int64_t{p.sequence}, cell(p.measured_at), p.raw}).value();
    if (known.empty())
        throw ise::error(ise::errc::malformed,
                         fmt::format("{}: packet {} of boot {} is neither there nor can be put there", db_->file(),
                                     p.sequence, p.boot));
    made.position = number_in(known.front(), 0);
    if (known.front().integer(1) == 0) damaged(made.position);
    if (at_peer != 0) note_at_peer(made.position, at_peer);
    return made;
}

void packet_table::note_at_peer(std::uint64_t position, std::uint64_t at_peer) {
    static const auto sql = sets_at_peer("?1", "position = ?2");
    if (db_->execute(sql, {cell(at_peer), cell(position)}).value() > 0) return;
    if (!db_->query("SELECT 1 FROM packets WHERE position = ?", {cell(position)}).value().empty()) damaged(position);
}

void packet_table::forget_at_peer(std::uint64_t after) {
    static const auto sql = sets_at_peer("NULL", "peer_position > ?");
    db_->execute(sql, {bounded_cell(after)}).value();
}

std::vector<telemetry_packet> packet_table::select(std::string_view sql, ise::database::values bound) {
    std::vector<telemetry_packet> made;
    auto rows = db_->query(sql, bound).value();
    for (const auto& row : rows) {
        if (row.integer(9) == 0) damaged(number_in(row, 0));
        made.push_back(packet_in(row));
    }
    return made;
}

std::vector<telemetry_packet> packet_table::page(std::uint64_t after, std::uint64_t up_to, std::size_t most) {
    static const auto sql = packet_select + "WHERE position > ? AND position <= ? ORDER BY position LIMIT ?";
    return select(sql, {bounded_cell(after), bounded_cell(up_to), cell(most)});
}

std::vector<telemetry_packet> packet_table::page(std::uint64_t after, std::uint64_t up_to, std::uint64_t at_peer,
                                                 const track_request& request, std::size_t most) {
    static const auto sql = packet_select +
                            "WHERE position > ? AND position <= ? AND (peer_position IS NULL OR peer_position > ?)"
                            " AND measured >= ? AND measured < ? ORDER BY position LIMIT ?";
    auto from = request.from ? cell(*request.from) : std::numeric_limits<std::int64_t>::min();
    auto until = request.until ? cell(*request.until) : std::numeric_limits<std::int64_t>::max();
    return select(sql, {bounded_cell(after), bounded_cell(up_to), bounded_cell(at_peer), from, until, cell(most)});
}

std::vector<std::pair<std::uint8_t, utc_time>> packet_table::newest() {
    auto lead = std::chrono::duration_cast<std::chrono::milliseconds>(newest_by_kind::max_lead).count();
    auto rows = db_->query("SELECT kind, max(min(measured, received + ?)) FROM packets WHERE history = 0 GROUP BY kind",
                           {std::int64_t{lead}});
    std::vector<std::pair<std::uint8_t, utc_time>> made;
    for (const auto& row : rows.value()) made.emplace_back(static_cast<std::uint8_t>(row.integer(0)), time_in(row, 1));
    return made;
}

// 1 is the type of a location on air.
std::optional<telemetry_packet> packet_table::last_location() {
    static const auto sql = packet_select + "WHERE kind = 1 AND history = 0 ORDER BY measured DESC LIMIT 1";
    auto found = select(sql, {});
    return found.empty() ? std::nullopt : std::optional(std::move(found.front()));
}

// By number, not by time: a clock that was wrong for a while must not cost what is new.
std::int64_t packet_table::prune(std::uint64_t up_to) {
    return db_
        ->execute("DELETE FROM packets WHERE position IN (SELECT position FROM packets WHERE position <= ? ORDER BY "
                  "position LIMIT 2000)",
                  {cell(up_to)})
        .value();
}

std::int64_t packet_table::seal() {
    static const auto sql = fmt::format(
        "UPDATE packets SET sum = {} WHERE position IN (SELECT position FROM packets WHERE sum IS NULL LIMIT 2000)",
        packet_sum);
    return db_->execute(sql).value();
}

} // namespace atirma
