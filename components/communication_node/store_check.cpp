#include <components/communication_node/store_check.hpp>

#include <components/communication_node/store_rows.hpp>

#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <limits>

namespace atirma {
namespace {

using namespace store_rows;

constexpr std::size_t max_told = 20;

/// The file of a program that wrote no checksums is taken as it is.
std::string_view if_sealed(std::uint64_t version, std::string_view is_sound) { return version >= 2 ? is_sound : "1"; }

template <class Packet>
std::optional<Packet> readable(const std::string& json) {
    try {
        return ise::from_json<Packet>(json);
    } catch (const ise::error&) {
        return std::nullopt;
    }
}

} // namespace

ise::result<store_reader> store_reader::open(const std::string& file) {
    auto opened = ise::database::open_to_read(file);
    if (!opened) return opened.error();
    auto version = opened->query("PRAGMA user_version");
    if (!version) return version.error();
    auto tables =
        opened->query("SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('packets', 'commands')");
    if (!tables) return tables.error();
    if (tables->at(0).integer(0) != 2)
        return ise::failure(
            ise::errc::malformed,
            fmt::format("{}: is not a store of a communication node: it has no packets or telecommands", file));
    return store_reader(std::move(*opened), number_in(version->at(0), 0));
}

void store_reader::unreadable(std::string why) {
    if (found_.unreadable.size() < max_told) found_.unreadable.push_back(std::move(why));
}

/// A part that cannot be read is stepped over in strides that double, until something can be read again.
std::vector<ise::database_row> store_reader::next_rows(std::string_view sql, std::int64_t& after, std::size_t most,
                                                       std::size_t place) {
    std::int64_t stride = 1;
    bool reported = false;
    for (;;) {
        // Where many together fail, one of them may be readable.
        for (auto some : {most, std::size_t{1}}) {
            auto rows = db_.query(sql, {after, cell(std::uint64_t{some})});
            if (rows) {
                if (!rows->empty()) after = rows->back().integer(place);
                return std::move(*rows);
            }
            if (!std::exchange(reported, true)) unreadable(rows.error().message());
        }
        if (after > std::numeric_limits<std::int64_t>::max() - stride) return {};
        after += stride;
        stride = stride > std::numeric_limits<std::int64_t>::max() / 2 ? stride : stride * 2;
    }
}

std::vector<telemetry_packet> store_reader::next_packets(std::size_t most) {
    auto sql = fmt::format("SELECT {}, {}, {} FROM packets WHERE position > ? ORDER BY position LIMIT ?",
                           packet_columns, if_sealed(schema_, packet_is_sound), schema_ >= 2 ? "sum IS NULL" : "1");
    std::vector<telemetry_packet> made;
    while (made.empty()) { // all of a page may be damaged
        auto rows = next_rows(sql, last_packet_, most, 0);
        if (rows.empty()) break;
        for (const auto& row : rows) {
            if (row.integer(9) == 0) {
                ++found_.damaged_packets;
                if (found_.damaged_positions.size() < max_told) found_.damaged_positions.push_back(number_in(row, 0));
                continue;
            }
            ++found_.packets;
            if (row.integer(10) != 0) ++found_.unsealed;
            made.push_back(packet_in(row));
        }
    }
    return made;
}

std::vector<command_record> store_reader::next_commands(std::size_t most) {
    auto sql = fmt::format("SELECT record, {}, number FROM commands WHERE number > ? ORDER BY number LIMIT ?",
                           if_sealed(schema_, command_is_sound));
    std::vector<command_record> made;
    while (made.empty()) {
        auto rows = next_rows(sql, last_command_, most, 2);
        if (rows.empty()) break;
        for (const auto& row : rows) {
            auto record = readable<command_record>(row.text(0));
            if (row.integer(1) == 0 || !record) {
                ++found_.damaged_telecommands;
                continue;
            }
            ++found_.telecommands;
            made.push_back(std::move(*record));
        }
    }
    return made;
}

std::pair<authority_state, std::uint64_t> store_reader::authority() {
    std::pair<authority_state, std::uint64_t> made;
    auto rows = db_.query(fmt::format("SELECT state, change FROM authority WHERE {} ORDER BY epoch DESC LIMIT 1",
                                      if_sealed(schema_, authority_is_sound)));
    if (!rows || rows->empty()) return made;
    auto state = readable<authority_state>(rows->front().text(0));
    if (state) made = {std::move(*state), number_in(rows->front(), 1)};
    return made;
}

void store_reader::check_the_rest() {
    auto structure = db_.query("PRAGMA integrity_check(20)");
    if (!structure) unreadable(structure.error().message());
    else
        for (const auto& row : *structure)
            if (row.text(0) != "ok") unreadable(row.text(0));
    if (schema_ < 2) return;
    for (auto [table, is_sound] : {std::pair{"authority", authority_is_sound}, std::pair{"meta", meta_is_sound},
                                   std::pair{"lives", life_is_sound}}) {
        auto rows = db_.query(fmt::format("SELECT count(*) FROM {} WHERE NOT {}", table, is_sound));
        if (!rows) unreadable(rows.error().message());
        else if (auto damaged = rows->at(0).integer(0); damaged != 0)
            unreadable(fmt::format("{} of the rows of '{}' differ from their checksums", damaged, table));
    }
}

ise::result<store_verdict> check_store(const std::string& file) {
    auto reader = store_reader::open(file);
    if (!reader) return reader.error();
    while (!reader->next_packets(1000).empty()) {}
    while (!reader->next_commands(1000).empty()) {}
    reader->check_the_rest();
    const auto& found = reader->found();
    store_verdict made;
    made.sound = found.damaged_packets == 0 && found.damaged_telecommands == 0 && found.unreadable.empty();
    made.text = fmt::format("{}: {} packets and {} telecommands are sound\n", file, found.packets, found.telecommands);
    if (found.unsealed != 0)
        made.text += fmt::format("{} packets have no checksum yet: an older program wrote them; the communication node "
                                 "adds the checksums while it runs\n",
                                 found.unsealed);
    if (found.damaged_packets != 0) {
        made.text += fmt::format("{} packets differ from their checksums, at positions", found.damaged_packets);
        for (auto position : found.damaged_positions) made.text += fmt::format(" {}", position);
        made.text += found.damaged_packets > found.damaged_positions.size() ? " …\n" : "\n";
    }
    if (found.damaged_telecommands != 0)
        made.text += fmt::format("{} telecommands differ from their checksums\n", found.damaged_telecommands);
    for (const auto& what : found.unreadable) made.text += what + "\n";
    made.text += made.sound ? "the file is sound\n"
                            : "the file is damaged; a communication node that meets the damage sets the file aside and "
                              "fills a new one from this file and from the other node\n";
    return made;
}

} // namespace atirma
