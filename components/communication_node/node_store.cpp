#include <components/communication_node/node_store.hpp>

#include <components/communication_node/newest_by_kind.hpp>

#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <array>
#include <limits>

namespace atirma {
namespace {

constexpr std::array<std::string_view, 1> schema{
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
    "CREATE TABLE authority(epoch INTEGER PRIMARY KEY, change INTEGER NOT NULL, state TEXT NOT NULL)"};

constexpr std::string_view columns = "position, boot, sequence, measured, link, received, history, raw, peer_position";

// SQLite's integers have a sign; the bits are the same.
std::int64_t cell(std::uint64_t value) { return static_cast<std::int64_t>(value); }
std::uint64_t number_in(const database_row& row, std::size_t column) {
    return static_cast<std::uint64_t>(row.integer(column));
}
std::int64_t cell(utc_time at) { return at.time_since_epoch().count(); }
std::int64_t until_cell(std::uint64_t value) {
    return value > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())
               ? std::numeric_limits<std::int64_t>::max()
               : cell(value);
}
utc_time time_in(const database_row& row, std::size_t column) {
    return utc_time(std::chrono::milliseconds(row.integer(column)));
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
    auto made = opened->execute("INSERT OR IGNORE INTO meta(name, value) VALUES('store', ?)", {cell(fresh_number | 1)});
    if (!made) return made.error();
    node_store store(std::move(*opened), 0);
    if (auto loaded = store.load(); !loaded) return loaded.error();
    return store;
}

ise::result<void> node_store::load() {
    auto rows = db_.query("SELECT name, value FROM meta");
    if (!rows) return rows.error();
    for (const auto& row : *rows) {
        auto name = row.text(0);
        if (name == "store") number_ = number_in(row, 1);
        else if (name == "peer") peer_.store = number_in(row, 1);
        else if (name == "peer_packets") peer_.packets = number_in(row, 1);
        else if (name == "peer_commands") peer_.commands = number_in(row, 1);
        else if (name == "head") head_ = number_in(row, 1);
        else if (name == "commands_head") commands_head_ = number_in(row, 1);
    }
    return {};
}

// Known already: its position, and that at the peer is noted.
ise::result<std::uint64_t> node_store::insert(const telemetry_packet& p, std::uint64_t at_peer, std::uint64_t& head,
                                              std::uint32_t& fresh) {
    auto kind = p.raw.size() > 1 ? std::to_integer<std::int64_t>(p.raw[1]) : 0;
    database_value there;
    if (at_peer != 0) there = cell(at_peer);
    auto made = db_.execute(
        "INSERT OR IGNORE INTO packets(position, boot, sequence, measured, link, received, history, kind, raw, "
        "peer_position)"
        " VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        {cell(head + 1), std::int64_t{p.boot}, std::int64_t{p.sequence}, cell(p.measured_at),
         static_cast<std::int64_t>(p.link), cell(p.received_at), std::int64_t{p.history}, kind, p.raw, there});
    if (!made) return made.error();
    if (*made > 0) {
        ++fresh;
        return ++head;
    }
    auto known = db_.query("SELECT position FROM packets WHERE boot = ? AND sequence = ? AND measured = ?",
                           {std::int64_t{p.boot}, std::int64_t{p.sequence}, cell(p.measured_at)});
    if (!known) return known.error();
    if (known->empty())
        return ise::failure(ise::errc::io_failed,
                            fmt::format("{}: packet {} of boot {} is neither there nor can be put there", db_.file(),
                                        p.sequence, p.boot));
    auto position = number_in(known->front(), 0);
    if (at_peer == 0) return position;
    auto noted =
        db_.execute("UPDATE packets SET peer_position = ? WHERE position = ?", {cell(at_peer), cell(position)});
    if (!noted) return noted.error();
    return position;
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
    auto noted = db_.execute("INSERT OR REPLACE INTO meta(name, value) VALUES('head', ?)", {cell(head)});
    if (!noted) return noted.error();
    if (auto done = whole.commit(); !done) return done.error();
    head_ = head;
    return made;
}

telemetry_packet node_store::packet_of(const database_row& row) const {
    telemetry_packet made;
    made.store = number_;
    made.position = number_in(row, 0);
    made.boot = static_cast<std::uint16_t>(row.integer(1));
    made.sequence = static_cast<std::uint32_t>(row.integer(2));
    made.measured_at = time_in(row, 3);
    made.link = static_cast<link_id>(row.integer(4));
    made.received_at = time_in(row, 5);
    made.history = row.integer(6) != 0;
    made.raw = row.bytes(7);
    if (!row.is_null(8)) {
        made.peer_store = peer_.store;
        made.peer_position = number_in(row, 8);
    }
    return made;
}

ise::result<std::vector<telemetry_packet>> node_store::packets(std::uint64_t after, std::uint64_t up_to,
                                                               std::size_t most) {
    static const auto sql =
        fmt::format("SELECT {} FROM packets WHERE position > ? AND position <= ? ORDER BY position LIMIT ?", columns);
    auto rows = db_.query(sql, {until_cell(after), until_cell(up_to), cell(most)});
    if (!rows) return rows.error();
    std::vector<telemetry_packet> made;
    for (const auto& row : *rows) made.push_back(packet_of(row));
    return made;
}

ise::result<track_page> node_store::track(const track_request& request, std::uint64_t up_to) {
    static const auto sql = fmt::format(
        "SELECT {} FROM packets WHERE position > ? AND position <= ? AND (peer_position IS NULL OR peer_position > ?)"
        " AND measured >= ? AND measured < ? ORDER BY position LIMIT ?",
        columns);
    auto known_of = [&](std::uint64_t store) {
        auto found = request.seen.find(store);
        return store == 0 || found == request.seen.end() ? std::uint64_t{0} : found->second;
    };
    auto here = known_of(number_), there = known_of(peer_.store);
    auto from = request.from ? cell(*request.from) : std::numeric_limits<std::int64_t>::min();
    auto until = request.until ? cell(*request.until) : std::numeric_limits<std::int64_t>::max();
    auto most = std::size_t{request.max_packets};
    auto rows = db_.query(sql, {until_cell(here), until_cell(up_to), until_cell(there), from, until, cell(most + 1)});
    if (!rows) return rows.error();
    track_page made;
    made.more = rows->size() > most;
    made.seen = request.seen;
    for (const auto& row : *rows)
        if (made.packets.size() < most) made.packets.push_back(packet_of(row));
    // What lies between is known by the other node's numbers. A window of time says nothing about what lies outside.
    if (made.more) made.seen[number_] = made.packets.back().position;
    else if (up_to > here) made.seen[number_] = up_to;
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
    static const auto sql =
        fmt::format("SELECT {} FROM packets WHERE kind = ? AND history = 0 ORDER BY measured DESC LIMIT 1", columns);
    auto rows = db_.query(sql, {std::int64_t{kind}});
    if (!rows) return rows.error();
    std::optional<telemetry_packet> made;
    if (!rows->empty()) made = packet_of(rows->front());
    return made;
}

ise::result<void> node_store::write(const command_record& record, std::uint64_t position) {
    const auto& s = record.status;
    auto done = db_.execute(
        "INSERT INTO commands(id, position, open, asked_by, changed, record) VALUES(?, ?, ?, ?, ?, ?)"
        " ON CONFLICT(id) DO UPDATE SET position = excluded.position, open = excluded.open, changed = "
        "excluded.changed, record = excluded.record",
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
    auto noted = db_.execute("INSERT OR REPLACE INTO meta(name, value) VALUES('commands_head', ?)", {cell(head)});
    if (!noted) return noted.error();
    if (auto done = whole.commit(); !done) return done.error();
    commands_head_ = head;
    return {};
}

static ise::result<std::vector<command_record>> records_of(const ise::result<std::vector<database_row>>& rows,
                                                           const std::string& file) {
    if (!rows) return rows.error();
    std::vector<command_record> made;
    try {
        for (const auto& row : *rows) made.push_back(ise::from_json<command_record>(row.text(0)));
    } catch (const ise::error& unreadable) {
        return ise::failure(ise::errc::io_failed,
                            fmt::format("{}: a telecommand is not readable: {}", file, unreadable.what()));
    }
    return made;
}

ise::result<std::optional<command_record>> node_store::command(std::uint32_t id) {
    auto found = records_of(db_.query("SELECT record FROM commands WHERE id = ?", {std::int64_t{id}}), db_.file());
    if (!found) return found.error();
    std::optional<command_record> made;
    if (!found->empty()) made = found->front();
    return made;
}

ise::result<std::vector<command_record>> node_store::open_commands() {
    return records_of(db_.query("SELECT record FROM commands WHERE open = 1 ORDER BY number LIMIT 1000"), db_.file());
}

ise::result<record_page> node_store::list(const record_request& request) {
    auto before = request.before == 0 ? std::numeric_limits<std::int64_t>::max() : cell(request.before);
    auto most = std::int64_t{request.max_entries} + 1;
    auto rows =
        request.asked_by.empty()
            ? db_.query("SELECT record, number FROM commands WHERE number < ? ORDER BY number DESC LIMIT ?",
                        {before, most})
            : db_.query(
                  "SELECT record, number FROM commands WHERE number < ? AND asked_by = ? ORDER BY number DESC LIMIT ?",
                  {before, request.asked_by, most});
    auto found = records_of(rows, db_.file());
    if (!found) return found.error();
    record_page made;
    if (found->size() > request.max_entries) {
        found->pop_back();
        made.before = number_in(rows->at(found->size() - 1), 1);
    }
    for (auto& record : *found) made.entries.push_back(std::move(record.status));
    if (request.before != 0) return made;
    auto changes = db_.query("SELECT state FROM authority ORDER BY epoch DESC LIMIT 20");
    if (!changes) return changes.error();
    for (const auto& row : *changes) made.authority.push_back(ise::from_json<authority_state>(row.text(0)));
    return made;
}

ise::result<void> node_store::write(const authority_state& state, std::uint64_t change) {
    auto done = db_.execute("INSERT OR REPLACE INTO authority(epoch, change, state) VALUES(?, ?, ?)",
                            {std::int64_t{state.epoch}, cell(change), ise::to_json(state)});
    if (!done) return done.error();
    return {};
}

ise::result<void> node_store::put(const authority_state& state, std::uint64_t change) { return write(state, change); }

ise::result<std::pair<authority_state, std::uint64_t>> node_store::authority() {
    auto rows = db_.query("SELECT state, change FROM authority ORDER BY epoch DESC LIMIT 1");
    if (!rows) return rows.error();
    std::pair<authority_state, std::uint64_t> made;
    if (!rows->empty()) made = {ise::from_json<authority_state>(rows->front().text(0)), number_in(rows->front(), 1)};
    return made;
}

ise::result<replication_page> node_store::page_after(std::uint64_t asker, std::uint64_t after, std::uint64_t commands,
                                                     std::size_t most) {
    replication_page made;
    made.store = number_;
    auto found = packets(after, std::numeric_limits<std::uint64_t>::max(), most);
    if (!found) return found.error();
    for (auto& packet : *found) {
        auto& one = made.packets.emplace_back();
        one.position = packet.position;
        if (packet.peer_store == asker)
            one.yours = packet.peer_position; // its disk may be another one than the one that had it
        if (one.yours == 0) one.packet = std::move(packet);
    }
    auto rows = db_.query("SELECT record, position FROM commands WHERE position > ? ORDER BY position LIMIT ?",
                          {until_cell(commands), cell(most)});
    auto records = records_of(rows, db_.file());
    if (!records) return records.error();
    made.commands = std::move(*records);
    made.commands_up_to = made.commands.empty() ? commands : number_in(rows->back(), 1);
    made.more = (!made.packets.empty() && made.packets.back().position < head_) || made.commands_up_to < commands_head_;
    return made;
}

ise::result<std::uint32_t> node_store::apply(const replication_page& page, std::span<const command_record> news,
                                             bool authority_is_news) {
    transaction whole(db_);
    if (!whole.begun()) return whole.begun().error();
    auto peer = peer_;
    if (page.store != peer.store) { // its disk is another one: the numbers that we know of it mean nothing any more
        auto reset = db_.execute("UPDATE packets SET peer_position = NULL WHERE peer_position IS NOT NULL");
        if (!reset) return reset.error();
        peer = peer_position{page.store, 0, 0};
    }
    auto head = head_;
    std::uint32_t fresh = 0;
    for (const auto& one : page.packets) {
        if (one.position <= peer.packets)
            return ise::failure(ise::errc::malformed,
                                fmt::format("the other node tells packet {} after {}", one.position, peer.packets));
        peer.packets = one.position;
        if (one.yours != 0) {
            auto noted = db_.execute("UPDATE packets SET peer_position = ? WHERE position = ?",
                                     {cell(one.position), cell(one.yours)});
            if (!noted) return noted.error();
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
    auto note = [this](const char* name, std::uint64_t value) {
        return db_.execute("INSERT OR REPLACE INTO meta(name, value) VALUES(?, ?)", {std::string(name), cell(value)});
    };
    for (auto& [name, value] :
         std::initializer_list<std::pair<const char*, std::uint64_t>>{{"peer", peer.store},
                                                                      {"peer_packets", peer.packets},
                                                                      {"peer_commands", peer.commands},
                                                                      {"head", head},
                                                                      {"commands_head", commands_head}})
        if (auto noted = note(name, value); !noted) return noted.error();
    if (auto done = whole.commit(); !done) return done.error();
    peer_ = peer;
    head_ = head;
    commands_head_ = commands_head;
    return fresh;
}

// By number, not by time: a clock that was wrong for a while must not cost what is new.
ise::result<std::int64_t> node_store::prune(std::uint64_t keep_packets, std::uint64_t keep_commands) {
    auto packets = db_.execute(
        "DELETE FROM packets WHERE position IN (SELECT position FROM packets WHERE position <= ? ORDER BY "
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

} // namespace atirma
