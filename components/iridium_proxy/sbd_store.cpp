#include <components/iridium_proxy/sbd_store.hpp>

#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace atirma {
namespace {

constexpr std::array<std::string_view, 6> schema{
    "CREATE TABLE mo(imei TEXT NOT NULL, momsn INTEGER NOT NULL, session_time INTEGER NOT NULL, path TEXT NOT NULL, "
    "status INTEGER NOT NULL,"
    " mtmsn INTEGER NOT NULL, latitude REAL, longitude REAL, cep_km REAL, data BLOB NOT NULL, received_at INTEGER NOT "
    "NULL,"
    " published INTEGER NOT NULL DEFAULT 0, UNIQUE(imei, momsn, session_time));\n"
    "CREATE INDEX mo_unpublished ON mo(published) WHERE published = 0;\n"
    "CREATE TABLE mt(id INTEGER PRIMARY KEY, command TEXT NOT NULL, ordinal INTEGER NOT NULL, stage INTEGER NOT NULL, "
    "may_have_left INTEGER NOT NULL,"
    " text TEXT NOT NULL, result INTEGER, value REAL, reference TEXT NOT NULL, attempts INTEGER NOT NULL, asked_at "
    "INTEGER NOT NULL,"
    " expires_at INTEGER NOT NULL, changed_at INTEGER NOT NULL, next_try INTEGER NOT NULL);\n"
    "CREATE TABLE spending(day TEXT NOT NULL, to_boat INTEGER NOT NULL, messages INTEGER NOT NULL, bytes INTEGER NOT "
    "NULL, credits INTEGER NOT NULL,"
    " PRIMARY KEY(day, to_boat))", // spending_book::table
    "ALTER TABLE mt ADD COLUMN authority INTEGER NOT NULL DEFAULT 0",
    "ALTER TABLE mt ADD COLUMN boat_obeys INTEGER;\n"
    "CREATE TABLE clock(one INTEGER PRIMARY KEY CHECK(one = 1), ahead INTEGER NOT NULL)",
    "ALTER TABLE mt ADD COLUMN executed_at INTEGER",
    "ALTER TABLE mt ADD COLUMN unreadable INTEGER NOT NULL DEFAULT 0",
    "ALTER TABLE clock ADD COLUMN shown INTEGER NOT NULL DEFAULT 0"};

std::int64_t number(utc_time at) { return at.time_since_epoch().count(); }
utc_time time_of(std::int64_t ms) { return utc_time(std::chrono::milliseconds(ms)); }

ise::database_value optional_real(const std::optional<double>& value) {
    return value ? ise::database_value(*value) : ise::database_value();
}

} // namespace

ise::result<sbd_store> sbd_store::open(const std::string& file, ise::when_damaged how) {
    auto opened = ise::database::open(file, schema, ise::when_damaged::keeping_readable(std::move(how)));
    if (!opened) return opened.error();
    return sbd_store(std::move(*opened));
}

ise::result<bool> sbd_store::add(const iridium::mo_message& message, std::string_view path, utc_time now,
                                 std::uint64_t credits) {
    std::optional<double> latitude, longitude, cep;
    if (message.where)
        latitude = message.where->latitude_deg, longitude = message.where->longitude_deg, cep = message.where->cep_km;
    return db_.transaction([&]() -> ise::result<bool> {
        auto added = db_.execute(
            "INSERT OR IGNORE INTO mo(imei, momsn, session_time, path, status, mtmsn, latitude, longitude, cep_km, "
            "data, received_at) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            {message.imei, std::int64_t{message.momsn}, std::int64_t{message.session_time.time_since_epoch().count()},
             std::string(path), std::int64_t{message.session_status}, std::int64_t{message.mtmsn},
             optional_real(latitude), optional_real(longitude), optional_real(cep), message.data, number(now)});
        if (!added) return added.error();
        if (*added != 1) return false;
        auto charged =
            charge(now, false, 1, static_cast<std::int64_t>(message.data.size()), static_cast<std::int64_t>(credits));
        if (!charged) return charged.error();
        return true;
    });
}

ise::result<std::vector<sbd_store::kept_message>> sbd_store::unpublished(std::size_t most, std::int64_t after) {
    auto rows = db_.query(
        "SELECT rowid, imei, momsn, session_time, status, mtmsn, latitude, longitude, cep_km, data, received_at FROM mo"
        " WHERE published = 0 AND rowid > ? ORDER BY rowid LIMIT ?",
        {after, static_cast<std::int64_t>(most)});
    if (!rows) return rows.error();
    std::vector<kept_message> out;
    for (const auto& row : *rows) {
        kept_message one;
        one.row = row.integer(0);
        auto& m = one.message;
        m.imei = row.text(1);
        m.momsn = static_cast<std::uint16_t>(row.integer(2));
        m.session_time = std::chrono::sys_seconds(std::chrono::seconds(row.integer(3)));
        m.session_status = static_cast<std::uint8_t>(row.integer(4));
        m.mtmsn = static_cast<std::uint16_t>(row.integer(5));
        if (!row.is_null(6)) m.where = iridium::estimate{row.real(6), row.real(7), row.real(8)};
        m.data = row.bytes(9);
        one.received_at = time_of(row.integer(10));
        out.push_back(std::move(one));
    }
    return out;
}

ise::result<std::uint64_t> sbd_store::count_unpublished() {
    auto rows = db_.query("SELECT count(*) FROM mo WHERE published = 0");
    if (!rows) return rows.error();
    return static_cast<std::uint64_t>(rows->at(0).integer(0));
}

ise::result<void> sbd_store::published(std::int64_t row) {
    auto done = db_.execute("UPDATE mo SET published = 1 WHERE rowid = ?", {row});
    if (!done) return done.error();
    return {};
}

ise::result<std::vector<tracked_telecommand>> sbd_store::load() {
    auto rows = db_.query(
        "SELECT id, command, ordinal, stage, may_have_left, text, result, value, reference, "
        "attempts, asked_at, expires_at,"
        " changed_at, next_try, authority, boat_obeys, executed_at, unreadable FROM mt ORDER BY changed_at DESC LIMIT "
        "1000");
    if (!rows) return rows.error();
    std::vector<tracked_telecommand> out;
    for (const auto& row : *rows) {
        tracked_telecommand e;
        e.id = static_cast<std::uint32_t>(row.integer(0));
        try {
            e.command = ise::from_json<boat_command>(row.text(1));
        } catch (const ise::error& why) {
            return ise::failure(ise::errc::io_failed,
                                fmt::format("{}: telecommand {} cannot be read: {}", db_.file(), e.id, why.what()));
        }
        e.order = static_cast<std::uint64_t>(row.integer(2));
        e.stage = static_cast<link_stage>(row.integer(3));
        e.may_have_left = row.integer(4) != 0;
        e.text = row.text(5);
        if (!row.is_null(6)) e.result = static_cast<ack_code>(row.integer(6));
        if (!row.is_null(7)) e.value = static_cast<float>(row.real(7));
        e.reference = row.text(8);
        e.attempts = static_cast<std::uint32_t>(row.integer(9));
        e.asked_at = time_of(row.integer(10));
        e.expires_at = civil_tracker_time(time_of(row.integer(11))).now;
        e.changed_at = time_of(row.integer(12));
        e.next_try = civil_tracker_time(time_of(row.integer(13))).now;
        e.authority = static_cast<std::uint32_t>(row.integer(14));
        if (!row.is_null(15)) e.boat_obeys = static_cast<std::uint32_t>(row.integer(15));
        e.valid_until = time_of(row.integer(11));
        if (!row.is_null(16)) e.executed_at = time_of(row.integer(16));
        e.unreadable = row.integer(17) != 0;
        out.push_back(std::move(e));
    }
    return out;
}

ise::result<void> sbd_store::save(const tracked_telecommand& e) {
    ise::database_value result, value, boat_obeys, executed_at;
    if (e.result) result = static_cast<std::int64_t>(*e.result);
    if (e.value) value = static_cast<double>(*e.value);
    if (e.boat_obeys) boat_obeys = std::int64_t{*e.boat_obeys};
    if (e.executed_at) executed_at = number(*e.executed_at);
    auto done =
        db_.execute("INSERT OR REPLACE INTO mt(id, command, ordinal, stage, may_have_left, text, result, "
                    "value, reference, attempts, asked_at,"
                    " expires_at, changed_at, next_try, authority, boat_obeys, executed_at, unreadable)"
                    " VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                    {std::int64_t{e.id}, ise::to_json(e.command), static_cast<std::int64_t>(e.order),
                     static_cast<std::int64_t>(e.stage), std::int64_t{e.may_have_left}, e.text, result, value,
                     e.reference, std::int64_t{e.attempts}, number(e.asked_at), number(civil_time_of(e.expires_at)),
                     number(e.changed_at), number(civil_time_of(e.next_try)), std::int64_t{e.authority}, boat_obeys,
                     executed_at, std::int64_t{e.unreadable}});
    if (!done) return done.error();
    return {};
}

ise::result<queue_clock> sbd_store::clock() {
    auto rows = db_.query("SELECT ahead, shown FROM clock");
    if (!rows) return rows.error();
    queue_clock made;
    if (rows->empty()) return made;
    made.ahead = std::chrono::milliseconds(rows->front().integer(0));
    made.last = time_of(rows->front().integer(1));
    return made;
}

ise::result<void> sbd_store::keep(const queue_clock& clock) {
    auto done = db_.execute("INSERT OR REPLACE INTO clock(one, ahead, shown) VALUES(1, ?, ?)",
                            {std::int64_t{clock.ahead.count()}, number(clock.last)});
    if (!done) return done.error();
    return {};
}

ise::result<void> sbd_store::begin_attempt(const tracked_telecommand& entry, utc_time now, std::size_t bytes,
                                           std::uint64_t credits) {
    return db_.transaction([&] {
        auto saved = save(entry);
        return saved ? charge(now, true, 1, static_cast<std::int64_t>(bytes), static_cast<std::int64_t>(credits))
                     : saved;
    });
}

ise::result<void> sbd_store::refund(utc_time charged_at, std::size_t bytes, std::uint64_t credits) {
    return charge(charged_at, true, -1, -static_cast<std::int64_t>(bytes), -static_cast<std::int64_t>(credits));
}

ise::result<void> sbd_store::charge(utc_time at, bool to_boat, std::int64_t messages, std::int64_t bytes,
                                    std::int64_t credits) {
    return spending_book(db_).charge(day_text(at), to_boat, {messages, bytes, credits});
}

ise::result<iridium_spending> sbd_store::spent(const std::string& days) {
    auto sums = spending_book(db_).spent(days);
    if (!sums) return sums.error();
    auto number = [](std::int64_t of) { return static_cast<std::uint64_t>(of); };
    iridium_spending out;
    out.mo_messages = number(sums->from_boat.messages), out.mo_bytes = number(sums->from_boat.bytes);
    out.mo_credits = number(sums->from_boat.credits);
    out.mt_messages = number(sums->to_boat.messages), out.mt_bytes = number(sums->to_boat.bytes);
    out.mt_credits = number(sums->to_boat.credits);
    return out;
}

ise::result<iridium_spending> sbd_store::spent_on(utc_time day) { return spent(day_text(day)); }
ise::result<iridium_spending> sbd_store::spent_in_month_of(utc_time day) { return spent(month_text(day)); }
ise::result<iridium_spending> sbd_store::spent_ever() { return spent(""); }

ise::result<void> sbd_store::forget_before(utc_time then) {
    auto messages = db_.execute("DELETE FROM mo WHERE published = 1 AND received_at < ?", {number(then)});
    if (!messages) return messages.error();
    auto commands = db_.execute("DELETE FROM mt WHERE stage >= ? AND changed_at < ?",
                                {static_cast<std::int64_t>(link_stage::acknowledged), number(then)});
    if (!commands) return commands.error();
    return {};
}

} // namespace atirma
