#include <components/communication_node/sqlite_store.hpp>

#include <components/communication_node/store_rows.hpp>

#include <fmt/format.h>

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

/// The result of `work`, or the failure that it throws.
template <class Work>
auto caught(Work work) -> ise::result<decltype(work())> {
    try {
        if constexpr (std::is_void_v<decltype(work())>) {
            work();
            return ise::result<void>();
        } else {
            return work();
        }
    } catch (const ise::error& problem) {
        return problem.why();
    }
}

/// All that `work` writes is kept, or nothing.
template <class Work>
auto together(ise::database& in, Work work) {
    return in.transaction([&] { return caught(work); });
}

void note(ise::database& in, const char* name, std::uint64_t value) {
    in.execute("INSERT OR REPLACE INTO meta(name, value, sum) VALUES(?1, ?2, row_sum(?1, ?2))",
               {std::string(name), cell(value)})
        .value();
}

void note_life(ise::database& in, const store_part& life, bool of_peer) {
    in.execute("INSERT OR REPLACE INTO lives(number, peer, packets, commands, sum) VALUES(?1, ?2, ?3, ?4, "
               "row_sum(?1, ?2, ?3, ?4))",
               {cell(life.store), std::int64_t{of_peer}, cell(life.packets), cell(life.commands)})
        .value();
    in.execute("DELETE FROM lives WHERE peer = ?1 AND place NOT IN (SELECT place FROM lives WHERE peer = ?1 ORDER BY "
               "place DESC LIMIT ?2)",
               {std::int64_t{of_peer}, cell(std::uint64_t{store_lives::most})})
        .value();
}

} // namespace

sqlite_store::sqlite_store(ise::database opened, store_lock lock)
    : lock_(std::move(lock)), db_(std::make_unique<ise::database>(std::move(opened))), packets_(*db_), records_(*db_) {}

ise::result<sqlite_store> sqlite_store::open(const std::string& file, std::uint64_t fresh_number) {
    auto lock = store_lock::take(file);
    if (!lock) return lock.error();
    return open(file, fresh_number, *lock);
}

ise::result<sqlite_store> sqlite_store::open(const std::string& file, std::uint64_t fresh_number, store_lock lock) {
    return caught([&] {
        sqlite_store store(ise::database::open(file, schema).value(), lock);
        store.load();
        store.begin_life(fresh_number).value();
        return store;
    });
}

void sqlite_store::load() {
    static const auto sql = fmt::format("SELECT name, value, {} FROM meta", meta_is_sound);
    auto rows = db_->query(sql).value();
    for (const auto& row : rows) {
        auto name = row.text(0);
        if (row.integer(2) == 0) throw ise::error(damaged_row(*db_, fmt::format("'{}'", name)));
        auto value = number_in(row, 1);
        if (name == "store") origin_ = value;
        else if (name == "life") own_.now.store = value;
        else if (name == "head") own_.now.packets = value;
        else if (name == "commands_head") own_.now.commands = value;
        else if (name == "peer") peer_.now.store = value;
        else if (name == "peer_packets") peer_.now.packets = value;
        else if (name == "peer_commands") peer_.now.commands = value;
    }
    static const auto of_lives =
        fmt::format("SELECT number, packets, commands, peer, {} FROM lives ORDER BY place DESC", life_is_sound);
    auto lives = db_->query(of_lives).value();
    for (const auto& row : lives) {
        if (row.integer(4) == 0) throw ise::error(damaged_row(*db_, "the record of an earlier life"));
        auto& life = (row.integer(3) != 0 ? peer_ : own_).over.emplace_back();
        life.store = number_in(row, 0);
        life.packets = number_in(row, 1);
        life.commands = number_in(row, 2);
    }
}

// Before anything is told of this life it is on the disk, so that the next one knows how far it came.
ise::result<void> sqlite_store::begin_life(std::uint64_t fresh_number) {
    auto number = fresh_number | 1;
    while (own_.find(number)) number += 2;
    auto own = own_;
    own.begin(number);
    auto origin = origin_ != 0 ? origin_ : number;
    auto written = together(*db_, [&] {
        if (!own.over.empty()) note_life(*db_, own.over.front(), false);
        note(*db_, "store", origin);
        note(*db_, "life", number);
    });
    if (!written) return written;
    own_ = std::move(own);
    origin_ = origin;
    return {};
}

std::vector<store_part> sqlite_store::known_of_peer() const {
    std::vector<store_part> made;
    if (peer_.now.store != 0) made.push_back(peer_.now);
    for (const auto& life : peer_.over)
        if (made.size() < replication_request::max_yours) made.push_back(life);
    return made;
}

ise::result<std::string> sqlite_store::set_aside(const ise::failure& cause, std::chrono::system_clock::time_point now,
                                                 const ise::logger& log) {
    auto file = this->file();
    db_->close();
    return ise::set_aside(file, cause, now, log);
}

ise::result<void> sqlite_store::begin_anew(std::uint64_t fresh_number) {
    auto opened = open(file(), fresh_number, lock_);
    if (!opened) return opened.error();
    *this = std::move(*opened);
    return {};
}

ise::result<sqlite_store::memory> sqlite_store::remembered() {
    return caught([&] {
        memory made;
        made.newest = packets_.newest();
        made.last_location = packets_.last_location();
        made.authority = records_.authority();
        made.open_commands = records_.open();
        return made;
    });
}

ise::result<sqlite_store::kept> sqlite_store::add(std::span<const telemetry_packet> packets) {
    auto head = own_.now.packets;
    auto made = together(*db_, [&] {
        kept all;
        for (const auto& packet : packets) {
            auto at = packets_.put(packet, head + 1, 0);
            all.last = std::max(all.last, at.position);
            if (!at.fresh) continue;
            ++all.fresh;
            ++head;
        }
        // Of its own, as packets may be pruned: a number is never used again.
        note(*db_, "head", head);
        return all;
    });
    if (made) own_.now.packets = head;
    return made;
}

/// Positions are those of this store, and of the other node's.
std::vector<telemetry_packet> sqlite_store::numbered(std::vector<telemetry_packet> packets) const {
    for (auto& packet : packets) {
        packet.store = number();
        if (packet.peer_position != 0) packet.peer_store = peer_.now.store;
    }
    return packets;
}

ise::result<std::vector<telemetry_packet>> sqlite_store::packets(std::uint64_t after, std::uint64_t up_to,
                                                                 std::size_t most) {
    return caught([&] { return numbered(packets_.page(after, up_to, most)); });
}

// Positions of a life that went on elsewhere count as far as that life is this store's too.
std::uint64_t sqlite_store::known_at_peer(const track_cursor& seen) const {
    std::uint64_t made = 0;
    for (const auto& [store, position] : seen)
        if (const auto* life = peer_.find(store))
            made = std::max(made, life == &peer_.now ? position : std::min(position, life->packets));
    return made;
}

ise::result<track_page> sqlite_store::track(const track_request& request, std::uint64_t up_to) {
    auto here = own_.known_by(request.seen), there = known_at_peer(request.seen);
    auto most = std::size_t{request.max_packets};
    auto found = caught([&] { return numbered(packets_.page(here, up_to, there, request, most + 1)); });
    if (!found) return found.error();
    track_page made;
    made.packets = std::move(*found);
    made.more = made.packets.size() > most;
    if (made.more) made.packets.pop_back();
    made.seen = request.seen;
    // From here on by the numbers of the present lives.
    for (const auto& life : own_.over) made.seen.erase(life.store);
    for (const auto& life : peer_.over) made.seen.erase(life.store);
    if (there != 0) made.seen[peer_.now.store] = there;
    // What lies between is known by the other node's numbers. A window of time says nothing about what lies outside.
    auto reached = made.more ? made.packets.back().position : std::max(here, up_to);
    if (reached != 0) made.seen[number()] = reached;
    return made;
}

ise::result<void> sqlite_store::put(std::span<const command_record> records) {
    auto head = own_.now.commands;
    auto done = together(*db_, [&] {
        for (const auto& record : records) records_.put(record, ++head);
        note(*db_, "commands_head", head);
    });
    if (done) own_.now.commands = head;
    return done;
}

ise::result<std::optional<command_record>> sqlite_store::command(std::uint32_t id) {
    return caught([&] { return records_.find(id); });
}

ise::result<record_page> sqlite_store::list(const record_request& request) {
    return caught([&] { return records_.list(request); });
}

ise::result<void> sqlite_store::put(const authority_state& state, std::uint64_t change) {
    return caught([&] { records_.put(state, change); });
}

ise::result<replication_page> sqlite_store::page_after(std::uint64_t asker, std::uint64_t after, std::uint64_t commands,
                                                       std::size_t most) {
    return caught([&] {
        replication_page made;
        made.origin = origin_;
        made.store = number();
        made.after = after;
        made.commands_after = commands;
        for (auto& packet : numbered(packets_.page(after, std::numeric_limits<std::uint64_t>::max(), most))) {
            auto& one = made.packets.emplace_back();
            one.position = packet.position;
            // Its disk may be another one than the one that had it.
            if (packet.peer_store == asker) one.yours = packet.peer_position;
            if (one.yours == 0) one.packet = std::move(packet);
        }
        std::tie(made.commands, made.commands_up_to) = records_.changed(commands, most);
        made.more =
            (!made.packets.empty() && made.packets.back().position < head()) || made.commands_up_to < commands_head();
        return made;
    });
}

ise::result<std::uint32_t> sqlite_store::apply(const replication_page& page,
                                               std::span<const command_record> new_commands, bool authority_is_news) {
    auto out_of_step = [](std::string why) { throw ise::error(ise::errc::protocol_error, std::move(why)); };
    auto own = own_.now;
    auto peer = peer_;
    auto applied = together(*db_, [&] {
        auto& known = peer.now;
        if (page.after > known.packets || page.commands_after > known.commands)
            out_of_step(fmt::format("the other node tells what follows packet {} and change {}; known are {} and {}",
                                    page.after, page.commands_after, known.packets, known.commands));
        if (page.after < known.packets || page.commands_after < known.commands) {
            forget_peer_after(page.after, page.commands_after);
            peer.cut(page.after, page.commands_after);
        }
        if (page.store != known.store) {
            if (known.store != 0) note_life(*db_, known, true);
            peer.begin(page.store);
        }
        std::uint32_t fresh = 0;
        for (const auto& one : page.packets) {
            if (one.position <= known.packets)
                out_of_step(fmt::format("the other node tells packet {} after {}", one.position, known.packets));
            known.packets = one.position;
            if (one.yours > own.packets)
                out_of_step(
                    fmt::format("the other node has packet {} from here, where {} are", one.yours, own.packets));
            if (one.yours != 0) {
                packets_.note_at_peer(one.yours, one.position);
            } else if (one.packet && packets_.put(*one.packet, own.packets + 1, one.position).fresh) {
                ++fresh;
                ++own.packets;
            }
        }
        for (const auto& record : new_commands) records_.put(record, ++own.commands);
        known.commands = std::max(known.commands, page.commands_up_to);
        if (authority_is_news) records_.put(page.authority, page.authority_change);
        note(*db_, "peer", known.store);
        note(*db_, "peer_packets", known.packets);
        note(*db_, "peer_commands", known.commands);
        note(*db_, "head", own.packets);
        note(*db_, "commands_head", own.commands);
        return fresh;
    });
    if (!applied) return applied;
    peer_ = std::move(peer);
    own_.now = own;
    return applied;
}

/// Its store went back in time, or is another one: what it had beyond that says nothing any more.
void sqlite_store::forget_peer_after(std::uint64_t packets, std::uint64_t commands) {
    packets_.forget_at_peer(packets);
    db_->execute("UPDATE lives SET packets = min(packets, ?1), commands = min(commands, ?2), sum = "
                 "row_sum(number, peer, min(packets, ?1), min(commands, ?2)) WHERE peer = 1",
                 {bounded_cell(packets), bounded_cell(commands)})
        .value();
}

ise::result<std::int64_t> sqlite_store::prune(std::uint64_t keep_packets, std::uint64_t keep_commands) {
    return caught(
        [&] { return packets_.prune(head() - std::min(head(), keep_packets)) + records_.prune(keep_commands); });
}

ise::result<std::int64_t> sqlite_store::seal() {
    return caught([&] { return packets_.seal(); });
}

void sqlite_store::begin(const command_record& record, std::uint32_t, then<begun> done) {
    auto written = put(std::span(&record, 1));
    if (written) done(begun());
    else done(written.error());
}

void sqlite_store::put(const change_of_authority& state, const std::pair<std::uint32_t, std::uint64_t>&,
                       then<std::optional<change_of_authority>> done) {
    auto written = put(state.first, state.second);
    if (written) done(std::optional<change_of_authority>());
    else done(written.error());
}

void sqlite_store::tend(std::uint64_t keep_packets, std::uint64_t keep_commands, then<std::int64_t> done) {
    auto removed = prune(keep_packets, keep_commands);
    if (!removed) return done(removed);
    auto sealed = seal();
    done(sealed ? ise::result<std::int64_t>(*removed + *sealed) : sealed);
}

} // namespace atirma
