#include <components/communication_node/node_store.hpp>

#include <components/boat/newest_by_kind.hpp>
#include <components/communication_node/store_rows.hpp>

#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

namespace atirma {
namespace {

using namespace store_rows;

constexpr std::array<std::string_view, 3> schema{
    "CREATE TABLE meta(name TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;"
    "CREATE TABLE packets(position INTEGER PRIMARY KEY, boot INTEGER NOT NULL, sequence INTEGER NOT NULL, "
    "measured INTEGER NOT NULL,"
    " link INTEGER NOT NULL, received INTEGER NOT NULL, history INTEGER NOT NULL, kind INTEGER NOT NULL, raw "
    "BLOB NOT NULL,"
    " peer_position INTEGER, UNIQUE(boot, sequence, measured));"
    "CREATE INDEX packets_by_time ON packets(measured);"
    "CREATE INDEX packets_by_kind ON packets(kind, history, measured);"
    "CREATE INDEX packets_at_peer ON packets(peer_position);"
    "CREATE TABLE commands(number INTEGER PRIMARY KEY AUTOINCREMENT, id INTEGER NOT NULL UNIQUE, position "
    "INTEGER NOT NULL, open INTEGER NOT NULL,"
    " asked_by TEXT NOT NULL, changed INTEGER NOT NULL, record TEXT NOT NULL);"
    "CREATE INDEX commands_by_change ON commands(position);"
    "CREATE TABLE authority(epoch INTEGER PRIMARY KEY, change INTEGER NOT NULL, state TEXT NOT NULL)",
    // Checksums, and lives. The packets get theirs later (`seal`): there may be millions.
    "ALTER TABLE packets ADD COLUMN sum INTEGER;"
    "CREATE INDEX packets_without_sum ON packets(position) WHERE sum IS NULL;"
    "ALTER TABLE commands ADD COLUMN sum INTEGER;"
    "UPDATE commands SET sum = row_sum(id, position, open, asked_by, changed, record);"
    "ALTER TABLE authority ADD COLUMN sum INTEGER;"
    "UPDATE authority SET sum = row_sum(epoch, change, state);"
    "ALTER TABLE meta ADD COLUMN sum INTEGER;"
    "INSERT INTO meta(name, value) SELECT 'life', value FROM meta WHERE name = 'store';"
    "UPDATE meta SET sum = row_sum(name, value);"
    "CREATE TABLE lives(place INTEGER PRIMARY KEY AUTOINCREMENT, number INTEGER NOT NULL UNIQUE, peer INTEGER NOT "
    "NULL, packets INTEGER NOT NULL, commands INTEGER NOT NULL, sum INTEGER NOT NULL)",
    // The content belongs to a packet's identity. Rows and their checksums stay as they are, also those without one.
    "CREATE TABLE packets_by_content(position INTEGER PRIMARY KEY, boot INTEGER NOT NULL, sequence INTEGER NOT NULL, "
    "measured INTEGER NOT NULL,"
    " link INTEGER NOT NULL, received INTEGER NOT NULL, history INTEGER NOT NULL, kind INTEGER NOT NULL, raw "
    "BLOB NOT NULL,"
    " peer_position INTEGER, sum INTEGER, UNIQUE(boot, sequence, measured, raw));"
    "INSERT INTO packets_by_content SELECT position, boot, sequence, measured, link, received, history, kind, raw, "
    "peer_position, sum FROM packets ORDER BY position;"
    "DROP TABLE packets;"
    "ALTER TABLE packets_by_content RENAME TO packets;"
    "CREATE INDEX packets_by_time ON packets(measured);"
    "CREATE INDEX packets_by_kind ON packets(kind, history, measured);"
    "CREATE INDEX packets_at_peer ON packets(peer_position);"
    "CREATE INDEX packets_without_sum ON packets(position) WHERE sum IS NULL"};

constexpr std::size_t lives_kept = 1000; // what follows a node and was away for more of its lives begins anew

const std::string packet_select = fmt::format("SELECT {}, {} FROM packets ", packet_columns, packet_is_sound);

std::int64_t until_cell(std::uint64_t value) {
    return value > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())
               ? std::numeric_limits<std::int64_t>::max()
               : cell(value);
}

ise::failure damaged(const database& in, std::string_view what) {
    return ise::failure(ise::errc::malformed,
                        fmt::format("{}: {} is damaged: it differs from its checksum", in.file(), what));
}
ise::failure damaged_packet(const database& in, std::uint64_t position) {
    return damaged(in, fmt::format("packet {}", position));
}

/// Rolls back unless it was committed.
class transaction {
public:
    explicit transaction(database& in) : db_(in), begun_(in.begin()) {}
    ~transaction() {
        if (begun_ && !done_) db_.rollback();
    }
    transaction(const transaction&) = delete;
    transaction& operator=(const transaction&) = delete;
    const ise::result<void>& begun() const { return begun_; }
    ise::result<void> commit() {
        done_ = true;
        return db_.commit();
    }

private:
    database& db_;
    ise::result<void> begun_;
    bool done_ = false;
};

} // namespace

ise::result<node_store> node_store::open(const std::string& file, std::uint64_t fresh_number) {
    auto opened = database::open(file, schema);
    if (!opened) return opened.error();
    node_store store(std::move(*opened));
    if (auto loaded = store.load(); !loaded) return loaded.error();
    if (auto begun = store.begin_life(fresh_number); !begun) return begun.error();
    return store;
}

ise::result<void> node_store::load() {
    static const auto sql = fmt::format("SELECT name, value, {} FROM meta", meta_is_sound);
    auto rows = db_.query(sql);
    if (!rows) return rows.error();
    for (const auto& row : *rows) {
        auto name = row.text(0);
        if (row.integer(2) == 0) return damaged(db_, fmt::format("'{}'", name));
        if (name == "store") origin_ = number_in(row, 1);
        else if (name == "life") number_ = number_in(row, 1);
        else if (name == "peer") peer_.store = number_in(row, 1);
        else if (name == "peer_packets") peer_.packets = number_in(row, 1);
        else if (name == "peer_commands") peer_.commands = number_in(row, 1);
        else if (name == "head") head_ = number_in(row, 1);
        else if (name == "commands_head") commands_head_ = number_in(row, 1);
    }
    static const auto of_lives =
        fmt::format("SELECT number, packets, commands, peer, {} FROM lives ORDER BY place DESC", life_is_sound);
    auto lives = db_.query(of_lives);
    if (!lives) return lives.error();
    for (const auto& row : *lives) {
        if (row.integer(4) == 0) return damaged(db_, "the record of an earlier life");
        auto& into = row.integer(3) != 0 ? peer_lives_ : lives_;
        auto& life = into.emplace_back();
        life.store = number_in(row, 0);
        life.packets = number_in(row, 1);
        life.commands = number_in(row, 2);
    }
    return {};
}

// Before anything is told of this life it is on the disk, so that the next one knows how far it came.
ise::result<void> node_store::begin_life(std::uint64_t fresh_number) {
    auto number = fresh_number | 1;
    auto used = [&](std::uint64_t candidate) {
        return candidate == number_ ||
               std::ranges::any_of(lives_, [&](const auto& life) { return life.store == candidate; });
    };
    while (used(number)) number += 2;
    transaction whole(db_);
    if (!whole.begun()) return whole.begun();
    auto lives = lives_;
    if (number_ != 0) {
        auto& last = lives.emplace_front();
        last.store = number_;
        last.packets = head_;
        last.commands = commands_head_;
        if (lives.size() > lives_kept) lives.pop_back();
        if (auto noted = note_life(last, false); !noted) return noted;
    }
    auto origin = origin_ != 0 ? origin_ : number;
    if (auto noted = note("store", origin); !noted) return noted;
    if (auto noted = note("life", number); !noted) return noted;
    if (auto done = whole.commit(); !done) return done;
    number_ = number;
    origin_ = origin;
    lives_ = std::move(lives);
    return {};
}

ise::result<void> node_store::note(const char* name, std::uint64_t value) {
    auto done = db_.execute("INSERT OR REPLACE INTO meta(name, value, sum) VALUES(?1, ?2, row_sum(?1, ?2))",
                            {std::string(name), cell(value)});
    if (!done) return done.error();
    return {};
}

ise::result<void> node_store::note_life(const store_part& life, bool of_peer) {
    auto done = db_.execute("INSERT OR REPLACE INTO lives(number, peer, packets, commands, sum) VALUES(?1, ?2, ?3, ?4, "
                            "row_sum(?1, ?2, ?3, ?4))",
                            {cell(life.store), std::int64_t{of_peer}, cell(life.packets), cell(life.commands)});
    if (!done) return done.error();
    auto trimmed = db_.execute("DELETE FROM lives WHERE peer = ?1 AND place NOT IN (SELECT place FROM lives WHERE peer "
                               "= ?1 ORDER BY place DESC LIMIT ?2)",
                               {std::int64_t{of_peer}, cell(lives_kept)});
    if (!trimmed) return trimmed.error();
    return {};
}

store_part node_store::shared(const store_part& known) const {
    store_part made;
    made.store = number_;
    if (known.store == number_ && known.packets <= head_ && known.commands <= commands_head_) return known;
    auto life = std::ranges::find_if(lives_, [&](const auto& one) { return one.store == known.store; });
    if (life == lives_.end()) return made;
    made.packets = std::min(known.packets, life->packets);
    made.commands = std::min(known.commands, life->commands);
    return made;
}

store_part node_store::shared(std::span<const store_part> known) const {
    store_part most;
    for (const auto& one : known) {
        auto part = shared(one);
        if (part.packets > most.packets || (part.packets == most.packets && part.commands > most.commands)) most = part;
    }
    return most;
}

std::vector<store_part> node_store::known_of_peer() const {
    std::vector<store_part> made;
    if (peer_.store != 0) made.push_back(peer_);
    for (const auto& life : peer_lives_)
        if (made.size() < replication_request::max_yours) made.push_back(life);
    return made;
}

ise::result<std::string> node_store::set_aside(const ise::failure& cause, std::chrono::system_clock::time_point now,
                                               const ise::logger& log) {
    auto file = db_.file();
    db_.close();
    return atirma::set_aside(file, cause, now, log);
}

ise::result<void> node_store::begin_anew(std::uint64_t fresh_number) {
    auto opened = open(db_.file(), fresh_number);
    if (!opened) return opened.error();
    *this = std::move(*opened);
    return {};
}

// Known already with the same content: its position, and that at the peer is noted. Another content under its numbers
// is another packet, so that a forged one does not take the place of the boat's own.
ise::result<std::uint64_t> node_store::insert(const telemetry_packet& p, std::uint64_t at_peer, std::uint64_t& head,
                                              std::uint32_t& fresh) {
    auto kind = p.raw.size() > 1 ? std::to_integer<std::int64_t>(p.raw[1]) : 0;
    database_value there;
    if (at_peer != 0) there = cell(at_peer);
    auto made = db_.execute(
        "INSERT OR IGNORE INTO packets(position, boot, sequence, measured, link, received, history, kind, raw, "
        "peer_position, sum) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, "
        "row_sum(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10))",
        {cell(head + 1), std::int64_t{p.boot}, std::int64_t{p.sequence}, cell(p.measured_at),
         static_cast<std::int64_t>(p.link), cell(p.received_at), std::int64_t{p.history}, kind, p.raw, there});
    if (!made) return made.error();
    if (*made > 0) {
        ++fresh;
        return ++head;
    }
    static const auto sql =
        fmt::format("SELECT position, {} FROM packets WHERE boot = ? AND sequence = ? AND measured = ? AND raw = ?",
                    packet_is_sound);
    auto known = db_.query(sql, {std::int64_t{p.boot}, std::int64_t{p.sequence}, cell(p.measured_at), p.raw});
    if (!known) return known.error();
    if (known->empty())
        return ise::failure(ise::errc::malformed,
                            fmt::format("{}: packet {} of boot {} is neither there nor can be put there", db_.file(),
                                        p.sequence, p.boot));
    auto position = number_in(known->front(), 0);
    if (known->front().integer(1) == 0) return damaged_packet(db_, position);
    if (at_peer == 0) return position;
    if (auto noted = note_at_peer(position, at_peer); !noted) return noted.error();
    return position;
}

// A packet that was pruned meanwhile is none to note.
ise::result<void> node_store::note_at_peer(std::uint64_t position, std::uint64_t there) {
    static const auto sql = fmt::format(
        "UPDATE packets SET peer_position = ?1, sum = iif(sum IS NULL, NULL, row_sum(position, boot, sequence, "
        "measured, link, received, history, kind, raw, ?1)) WHERE position = ?2 AND {}",
        packet_is_sound);
    auto noted = db_.execute(sql, {cell(there), cell(position)});
    if (!noted) return noted.error();
    if (*noted > 0) return {};
    auto row = db_.query("SELECT 1 FROM packets WHERE position = ?", {cell(position)});
    if (!row) return row.error();
    if (!row->empty()) return damaged_packet(db_, position);
    return {};
}

ise::result<node_store::kept> node_store::add(std::span<const telemetry_packet> packets) {
    transaction whole(db_);
    if (!whole.begun()) return whole.begun().error();
    kept made;
    auto head = head_;
    for (const auto& packet : packets) {
        auto at = insert(packet, 0, head, made.fresh);
        if (!at) return at.error();
        made.last = std::max(made.last, *at);
    }
    // Of its own, as packets may be pruned: a number is never used again.
    if (auto noted = note("head", head); !noted) return noted.error();
    if (auto done = whole.commit(); !done) return done.error();
    head_ = head;
    return made;
}

ise::result<telemetry_packet> node_store::packet_of(const database_row& row) const {
    if (row.integer(9) == 0) return damaged_packet(db_, number_in(row, 0));
    auto made = packet_in(row);
    made.store = number_;
    if (!row.is_null(8)) {
        made.peer_store = peer_.store;
        made.peer_position = number_in(row, 8);
    }
    return made;
}

ise::result<std::vector<telemetry_packet>> node_store::packets(std::uint64_t after, std::uint64_t up_to,
                                                               std::size_t most) {
    static const auto sql = packet_select + "WHERE position > ? AND position <= ? ORDER BY position LIMIT ?";
    auto rows = db_.query(sql, {until_cell(after), until_cell(up_to), cell(most)});
    if (!rows) return rows.error();
    std::vector<telemetry_packet> made;
    for (const auto& row : *rows) {
        auto packet = packet_of(row);
        if (!packet) return packet.error();
        made.push_back(std::move(*packet));
    }
    return made;
}

// Positions of a life that went on elsewhere count as far as that life is this store's too.
std::uint64_t node_store::known_in(const track_cursor& seen, bool of_peer) const {
    std::uint64_t made = 0;
    for (const auto& [store, position] : seen) {
        if (store == 0) continue;
        if (of_peer) {
            if (store == peer_.store) made = std::max(made, position);
            for (const auto& life : peer_lives_)
                if (life.store == store) made = std::max(made, std::min(position, life.packets));
        } else {
            store_part known;
            known.store = store;
            known.packets = position;
            made = std::max(made, shared(known).packets);
        }
    }
    return made;
}

ise::result<track_page> node_store::track(const track_request& request, std::uint64_t up_to) {
    static const auto sql = packet_select +
                            "WHERE position > ? AND position <= ? AND (peer_position IS NULL OR peer_position > ?)"
                            " AND measured >= ? AND measured < ? ORDER BY position LIMIT ?";
    auto here = known_in(request.seen, false), there = known_in(request.seen, true);
    auto from = request.from ? cell(*request.from) : std::numeric_limits<std::int64_t>::min();
    auto until = request.until ? cell(*request.until) : std::numeric_limits<std::int64_t>::max();
    auto most = std::size_t{request.max_packets};
    auto rows = db_.query(sql, {until_cell(here), until_cell(up_to), until_cell(there), from, until, cell(most + 1)});
    if (!rows) return rows.error();
    track_page made;
    made.more = rows->size() > most;
    made.seen = request.seen;
    for (const auto& row : *rows) {
        if (made.packets.size() == most) break;
        auto packet = packet_of(row);
        if (!packet) return packet.error();
        made.packets.push_back(std::move(*packet));
    }
    // From here on by the numbers of the present lives.
    for (const auto& life : lives_) made.seen.erase(life.store);
    for (const auto& life : peer_lives_) made.seen.erase(life.store);
    if (there != 0) made.seen[peer_.store] = there;
    // What lies between is known by the other node's numbers. A window of time says nothing about what lies outside.
    auto reached = made.more ? made.packets.back().position : std::max(here, up_to);
    if (reached != 0) made.seen[number_] = reached;
    return made;
}

ise::result<std::vector<std::pair<std::uint8_t, utc_time>>> node_store::newest() {
    auto lead = std::chrono::duration_cast<std::chrono::milliseconds>(newest_by_kind::max_lead).count();
    auto rows = db_.query("SELECT kind, max(min(measured, received + ?)) FROM packets WHERE history = 0 GROUP BY kind",
                          {std::int64_t{lead}});
    if (!rows) return rows.error();
    std::vector<std::pair<std::uint8_t, utc_time>> made;
    for (const auto& row : *rows) made.emplace_back(static_cast<std::uint8_t>(row.integer(0)), time_in(row, 1));
    return made;
}

ise::result<std::optional<telemetry_packet>> node_store::last_of(std::uint8_t kind) {
    static const auto sql = packet_select + "WHERE kind = ? AND history = 0 ORDER BY measured DESC LIMIT 1";
    auto rows = db_.query(sql, {std::int64_t{kind}});
    if (!rows) return rows.error();
    std::optional<telemetry_packet> made;
    if (rows->empty()) return made;
    auto packet = packet_of(rows->front());
    if (!packet) return packet.error();
    made = std::move(*packet);
    return made;
}

ise::result<void> node_store::write(const command_record& record, std::uint64_t position) {
    const auto& s = record.status;
    auto done =
        db_.execute("INSERT INTO commands(id, position, open, asked_by, changed, record, sum)"
                    " VALUES(?1, ?2, ?3, ?4, ?5, ?6, row_sum(?1, ?2, ?3, ?4, ?5, ?6))"
                    " ON CONFLICT(id) DO UPDATE SET position = excluded.position, open = excluded.open, asked_by = "
                    "excluded.asked_by, changed = excluded.changed, record = excluded.record, sum = excluded.sum",
                    {std::int64_t{s.id}, cell(position), std::int64_t{!is_final(s.state)}, s.asked_by, cell(s.at),
                     ise::to_json(record)});
    if (!done) return done.error();
    return {};
}

ise::result<void> node_store::put(std::span<const command_record> records) {
    transaction whole(db_);
    if (!whole.begun()) return whole.begun().error();
    auto head = commands_head_;
    for (const auto& record : records)
        if (auto done = write(record, ++head); !done) return done.error();
    if (auto noted = note("commands_head", head); !noted) return noted.error();
    if (auto done = whole.commit(); !done) return done.error();
    commands_head_ = head;
    return {};
}

/// Of a query that selects `command_columns` first.
static ise::result<std::vector<command_record>> records_of(const ise::result<std::vector<database_row>>& rows,
                                                           const database& in) {
    if (!rows) return rows.error();
    std::vector<command_record> made;
    try {
        for (const auto& row : *rows) {
            if (row.integer(1) == 0) return damaged(in, "a telecommand");
            made.push_back(ise::from_json<command_record>(row.text(0)));
        }
    } catch (const ise::error& unreadable) {
        return ise::failure(ise::errc::malformed,
                            fmt::format("{}: a telecommand is not readable: {}", in.file(), unreadable.what()));
    }
    return made;
}
static const std::string command_columns = fmt::format("record, {}", command_is_sound);
static const std::string authority_columns = fmt::format("state, change, {}", authority_is_sound);

ise::result<std::optional<command_record>> node_store::command(std::uint32_t id) {
    static const auto sql = fmt::format("SELECT {} FROM commands WHERE id = ?", command_columns);
    auto found = records_of(db_.query(sql, {std::int64_t{id}}), db_);
    if (!found) return found.error();
    std::optional<command_record> made;
    if (!found->empty()) made = found->front();
    return made;
}

ise::result<std::vector<command_record>> node_store::open_commands() {
    static const auto sql =
        fmt::format("SELECT {} FROM commands WHERE open = 1 ORDER BY number LIMIT 1000", command_columns);
    return records_of(db_.query(sql), db_);
}

ise::result<record_page> node_store::list(const record_request& request) {
    static const auto all =
        fmt::format("SELECT {}, number FROM commands WHERE number < ? ORDER BY number DESC LIMIT ?", command_columns);
    static const auto of_one =
        fmt::format("SELECT {}, number FROM commands WHERE number < ? AND asked_by = ? ORDER BY number DESC LIMIT ?",
                    command_columns);
    auto before = request.before == 0 ? std::numeric_limits<std::int64_t>::max() : cell(request.before);
    auto most = std::int64_t{request.max_entries} + 1;
    auto rows =
        request.asked_by.empty() ? db_.query(all, {before, most}) : db_.query(of_one, {before, request.asked_by, most});
    auto found = records_of(rows, db_);
    if (!found) return found.error();
    record_page made;
    if (found->size() > request.max_entries) {
        found->pop_back();
        made.before = number_in(rows->at(found->size() - 1), 2);
    }
    for (auto& record : *found) made.entries.push_back(std::move(record.status));
    if (request.before != 0) return made;
    static const auto of_authority =
        fmt::format("SELECT {} FROM authority ORDER BY epoch DESC LIMIT 20", authority_columns);
    auto changes = db_.query(of_authority);
    if (!changes) return changes.error();
    for (const auto& row : *changes) {
        if (row.integer(2) == 0) return damaged(db_, "a change of the authority");
        made.authority.push_back(ise::from_json<authority_state>(row.text(0)));
    }
    return made;
}

ise::result<void> node_store::write(const authority_state& state, std::uint64_t change) {
    auto done = db_.execute("INSERT OR REPLACE INTO authority(epoch, change, state, sum) VALUES(?1, ?2, ?3, "
                            "row_sum(?1, ?2, ?3))",
                            {std::int64_t{state.epoch}, cell(change), ise::to_json(state)});
    if (!done) return done.error();
    return {};
}

ise::result<void> node_store::put(const authority_state& state, std::uint64_t change) { return write(state, change); }

ise::result<std::pair<authority_state, std::uint64_t>> node_store::authority() {
    static const auto sql = fmt::format("SELECT {} FROM authority ORDER BY epoch DESC LIMIT 1", authority_columns);
    auto rows = db_.query(sql);
    if (!rows) return rows.error();
    std::pair<authority_state, std::uint64_t> made;
    if (!rows->empty() && rows->front().integer(2) == 0) return damaged(db_, "the authority");
    if (!rows->empty()) made = {ise::from_json<authority_state>(rows->front().text(0)), number_in(rows->front(), 1)};
    return made;
}

ise::result<replication_page> node_store::page_after(std::uint64_t asker, std::uint64_t after, std::uint64_t commands,
                                                     std::size_t most) {
    replication_page made;
    made.origin = origin_;
    made.store = number_;
    made.after = after;
    made.commands_after = commands;
    auto found = packets(after, std::numeric_limits<std::uint64_t>::max(), most);
    if (!found) return found.error();
    for (auto& packet : *found) {
        auto& one = made.packets.emplace_back();
        one.position = packet.position;
        // Its disk may be another one than the one that had it.
        if (packet.peer_store == asker) one.yours = packet.peer_position;
        if (one.yours == 0) one.packet = std::move(packet);
    }
    static const auto sql =
        fmt::format("SELECT {}, position FROM commands WHERE position > ? ORDER BY position LIMIT ?", command_columns);
    auto rows = db_.query(sql, {until_cell(commands), cell(most)});
    auto records = records_of(rows, db_);
    if (!records) return records.error();
    made.commands = std::move(*records);
    made.commands_up_to = made.commands.empty() ? commands : number_in(rows->back(), 2);
    made.more = (!made.packets.empty() && made.packets.back().position < head_) || made.commands_up_to < commands_head_;
    return made;
}

ise::result<std::uint32_t> node_store::apply(const replication_page& page, std::span<const command_record> news,
                                             bool authority_is_news) {
    auto out_of_step = [](std::string why) { return ise::failure(ise::errc::protocol_error, std::move(why)); };
    if (page.after > peer_.packets || page.commands_after > peer_.commands)
        return out_of_step(fmt::format("the other node tells what follows packet {} and change {}; known are {} and {}",
                                       page.after, page.commands_after, peer_.packets, peer_.commands));
    transaction whole(db_);
    if (!whole.begun()) return whole.begun().error();
    auto peer = peer_;
    auto peer_lives = peer_lives_;
    bool other_life = page.store != peer.store;
    if (page.after < peer.packets || page.commands_after < peer.commands) {
        if (auto cut = forget_peer_after(page.after, page.commands_after); !cut) return cut.error();
        for (auto& life : peer_lives) {
            life.packets = std::min(life.packets, page.after);
            life.commands = std::min(life.commands, page.commands_after);
        }
        peer.packets = page.after;
        peer.commands = page.commands_after;
    }
    if (other_life && peer.store != 0) {
        peer_lives.push_front(peer);
        if (peer_lives.size() > lives_kept) peer_lives.pop_back();
        if (auto noted = note_life(peer, true); !noted) return noted.error();
    }
    peer.store = page.store;
    auto head = head_;
    std::uint32_t fresh = 0;
    for (const auto& one : page.packets) {
        if (one.position <= peer.packets)
            return out_of_step(fmt::format("the other node tells packet {} after {}", one.position, peer.packets));
        peer.packets = one.position;
        if (one.yours > head)
            return out_of_step(fmt::format("the other node has packet {} from here, where {} are", one.yours, head));
        if (one.yours != 0) {
            if (auto noted = note_at_peer(one.yours, one.position); !noted) return noted.error();
        } else if (one.packet) {
            auto at = insert(*one.packet, one.position, head, fresh);
            if (!at) return at.error();
        }
    }
    auto commands_head = commands_head_;
    for (const auto& record : news)
        if (auto done = write(record, ++commands_head); !done) return done.error();
    peer.commands = std::max(peer.commands, page.commands_up_to);
    if (authority_is_news)
        if (auto done = write(page.authority, page.authority_change); !done) return done.error();
    for (auto& [name, value] :
         std::initializer_list<std::pair<const char*, std::uint64_t>>{{"peer", peer.store},
                                                                      {"peer_packets", peer.packets},
                                                                      {"peer_commands", peer.commands},
                                                                      {"head", head},
                                                                      {"commands_head", commands_head}})
        if (auto noted = note(name, value); !noted) return noted.error();
    if (auto done = whole.commit(); !done) return done.error();
    peer_ = peer;
    peer_lives_ = std::move(peer_lives);
    head_ = head;
    commands_head_ = commands_head;
    return fresh;
}

/// Its store went back in time, or is another one: what it had beyond that says nothing any more.
ise::result<void> node_store::forget_peer_after(std::uint64_t packets, std::uint64_t commands) {
    static const auto sql = fmt::format(
        "UPDATE packets SET peer_position = NULL, sum = iif(sum IS NULL, NULL, row_sum(position, boot, sequence, "
        "measured, link, received, history, kind, raw, NULL)) WHERE peer_position > ? AND {}",
        packet_is_sound);
    auto cut = db_.execute(sql, {until_cell(packets)});
    if (!cut) return cut.error();
    auto lives = db_.execute("UPDATE lives SET packets = min(packets, ?1), commands = min(commands, ?2), sum = "
                             "row_sum(number, peer, min(packets, ?1), min(commands, ?2)) WHERE peer = 1",
                             {until_cell(packets), until_cell(commands)});
    if (!lives) return lives.error();
    return {};
}

// By number, not by time: a clock that was wrong for a while must not cost what is new.
ise::result<std::int64_t> node_store::prune(std::uint64_t keep_packets, std::uint64_t keep_commands) {
    auto packets =
        db_.execute("DELETE FROM packets WHERE position IN (SELECT position FROM packets WHERE position <= ? ORDER BY "
                    "position LIMIT 2000)",
                    {cell(head_ - std::min(head_, keep_packets))});
    if (!packets) return packets.error();
    auto commands = db_.execute(
        "DELETE FROM commands WHERE number IN (SELECT number FROM commands WHERE open = 0 AND number <= (SELECT "
        "max(number) FROM commands) - ? ORDER BY number LIMIT 2000)",
        {cell(keep_commands)});
    if (!commands) return commands.error();
    return *packets + *commands;
}

ise::result<std::int64_t> node_store::seal() {
    static const auto sql = fmt::format(
        "UPDATE packets SET sum = {} WHERE position IN (SELECT position FROM packets WHERE sum IS NULL LIMIT 2000)",
        packet_sum);
    return db_.execute(sql);
}

} // namespace atirma
