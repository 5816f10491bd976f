#include <components/web_server/track_archive.hpp>

#include <components/web_server/archive_retention.hpp>
#include <components/web_server/archive_schema.hpp>

#include <algorithm>
#include <deque>
#include <optional>

namespace atirma {
namespace {

constexpr std::chrono::seconds tidying_period{5};

utc_ms time_of(std::int64_t number) { return utc_ms(std::chrono::milliseconds(number)); }
ise::database_value maybe(const std::optional<double>& value) {
    return value ? ise::database_value(*value) : ise::database_value();
}
std::optional<double> maybe(const ise::database_row& row, std::size_t column) {
    return row.is_null(column) ? std::nullopt : std::optional(row.real(column));
}

telemetry_packet packet_of(const ise::database_row& row) {
    telemetry_packet made;
    made.boot = static_cast<std::uint16_t>(row.integer(0));
    made.sequence = static_cast<std::uint32_t>(row.integer(1));
    made.link = static_cast<link_id>(row.integer(2));
    made.measured_at = time_of(row.integer(3));
    made.received_at = time_of(row.integer(4));
    made.history = row.integer(5) != 0;
    made.raw = row.bytes(6);
    return made;
}

} // namespace

struct track_archive::implementation {
    explicit implementation(archive_options chosen) : options(std::move(chosen)) {}

    struct fix_row {
        std::string boat, link;
        track_point point;
    };
    struct packet_row {
        std::string boat, kind;
        telemetry_packet packet;
    };

    ise::result<void> write(utc_ms now);
    ise::database& db() { return *opened; }
    ise::result<void> count();
    ise::result<void> enter(ise::database& into, const std::string& boat, const std::string& name);
    void begin_anew(ise::database& fresh);
    void bound_what_waits();
    std::size_t waiting() const { return fixes.size() + packets.size(); }

    archive_options options;
    std::optional<ise::database> opened;
    std::deque<fix_row> fixes;
    std::deque<packet_row> packets;
    std::map<std::pair<std::string, std::string>, utc_ms> heard;
    std::map<std::pair<std::string, std::string>, track_cursor> cursors, written_cursors;
    std::map<std::string, double> trips;
    std::map<std::string, std::string> names; // of the boats
    archive_statistics statistics;
    utc_ms tidied{};
};

track_archive::track_archive(std::unique_ptr<implementation> opened) : self_(std::move(opened)) {}
track_archive::~track_archive() = default;
const archive_statistics& track_archive::statistics() const noexcept { return self_->statistics; }

ise::result<std::unique_ptr<track_archive>> track_archive::open(const archive_options& options, ise::when_damaged how) {
    auto made = std::make_unique<implementation>(options);
    how.begun = [&self = *made](ise::database& fresh, const std::string&) { self.begin_anew(fresh); };
    auto db = ise::database::open(options.file, archive_schema, std::move(how));
    if (!db) return db.error();
    made->opened.emplace(std::move(*db));
    if (auto counted = made->count(); !counted) return counted.error();
    return std::unique_ptr<track_archive>(new track_archive(std::move(made)));
}

ise::result<void> track_archive::implementation::count() {
    auto rows = db().query("SELECT (SELECT count(*) FROM fix), (SELECT count(*) FROM telemetry)");
    if (!rows) return rows.error();
    statistics.fixes = static_cast<std::uint64_t>(rows->at(0).integer(0));
    statistics.packets = static_cast<std::uint64_t>(rows->at(0).integer(1));
    return {};
}

/// Everything else refers to the boats. One that cannot be entered shows with the next commit.
void track_archive::implementation::begin_anew(ise::database& fresh) {
    ++statistics.begun_anew;
    statistics.fixes = statistics.packets = 0;
    cursors.clear();
    written_cursors.clear();
    for (const auto& [boat, name] : names)
        if (auto entered = enter(fresh, boat, name); !entered) statistics.trouble = entered.error().message();
}

ise::result<void> track_archive::enter(const std::string& boat, const std::string& name) {
    self_->names[boat] = name;
    return self_->enter(self_->db(), boat, name);
}

ise::result<void> track_archive::implementation::enter(ise::database& into, const std::string& boat,
                                                       const std::string& name) {
    auto done = into.execute(
        "INSERT INTO boat (id, name) VALUES (?, ?) ON CONFLICT (id) DO UPDATE SET name = excluded.name", {boat, name});
    if (!done) return done.error();
    return {};
}

void track_archive::keep(const std::string& boat, const track_point& point, const std::string& link) {
    self_->fixes.push_back({boat, link, point});
    self_->bound_what_waits();
}

void track_archive::keep(const std::string& boat, const telemetry_packet& packet, std::string_view kind) {
    auto& self = *self_;
    self.packets.push_back({boat, std::string(kind), packet});
    if (!packet.history && packet.received_at != utc_time())
        keep_heard(boat, std::string(name_of(packet.link)), packet.received_at);
    self.bound_what_waits();
}

void track_archive::keep_heard(const std::string& boat, const std::string& link, utc_ms at) {
    auto& last = self_->heard[{boat, link}];
    last = std::max(last, at);
}

void track_archive::keep_cursor(const std::string& boat, const std::string& feed, const track_cursor& seen) {
    // After something was given up it must come again: whoever kept it is asked from where the file ends.
    auto& self = *self_;
    std::pair key{boat, feed};
    if (self.statistics.given_up != 0 || self.written_cursors[key] == seen) return;
    self.cursors[key] = seen;
}
void track_archive::keep_trip(const std::string& boat, double sailed_m) { self_->trips[boat] = sailed_m; }

void track_archive::implementation::bound_what_waits() {
    while (waiting() > options.max_waiting) {
        ++statistics.given_up;
        cursors.clear();
        if (fixes.size() > packets.size()) fixes.pop_front();
        else packets.pop_front();
    }
    statistics.waiting = waiting();
}

ise::result<void> track_archive::commit(utc_ms now) {
    auto& self = *self_;
    auto written = self.write(now);
    if (!written) {
        ++self.statistics.failed_commits;
        self.statistics.trouble = written.error().message();
        return written;
    }
    self.statistics.trouble.clear();
    if (now - self.tidied < tidying_period && now >= self.tidied) return {};
    self.tidied = now;
    archive_retention retention{self.options, self.db(), self.statistics};
    auto tidied = retention.tidy(now);
    if (!tidied) self.statistics.trouble = tidied.error().message();
    return tidied;
}

ise::result<void> track_archive::implementation::write(utc_ms now) {
    if (fixes.empty() && packets.empty() && cursors.empty()) return {};
    std::uint64_t new_fixes = 0, new_packets = 0;
    auto kept = db().transaction([&]() -> ise::result<void> {
        for (const auto& row : fixes) {
            const auto& p = row.point;
            auto known = db().query("SELECT 1 FROM fix WHERE boat = ? AND at = ?", {row.boat, archived(p.at)});
            if (!known) return known.error();
            auto done =
                db().execute("INSERT OR REPLACE INTO fix VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                             {row.boat, archived(p.at), p.latitude_deg, p.longitude_deg, maybe(p.speed_mps),
                              maybe(p.course_deg), maybe(p.heading_deg), maybe(p.heel_deg), maybe(p.wind_speed_mps),
                              maybe(p.wind_direction_deg), maybe(p.circular_error_m), row.link});
            if (!done) return done.error();
            new_fixes += known->empty() ? 1 : 0;
        }
        for (const auto& row : packets) {
            const auto& p = row.packet;
            auto done = db().execute(
                "INSERT OR IGNORE INTO telemetry (boat, boot, sequence, link, kind, measured_at, received_at, "
                "history, raw) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                {row.boat, std::int64_t{p.boot}, std::int64_t{p.sequence}, static_cast<std::int64_t>(p.link), row.kind,
                 archived(p.measured_at), archived(p.received_at), std::int64_t{p.history}, p.raw});
            if (!done) return done.error();
            new_packets += static_cast<std::uint64_t>(*done);
        }
        for (const auto& [where, at] : heard) {
            auto done = db().execute(
                "INSERT INTO heard VALUES (?, ?, ?) ON CONFLICT (boat, link) DO UPDATE SET at = max(at, excluded.at)",
                {where.first, where.second, archived(std::min(at, now))}); // a clock of the shore may be ahead
            if (!done) return done.error();
        }
        for (const auto& [where, seen] : cursors) {
            auto done = db().execute("DELETE FROM followed WHERE boat = ? AND feed = ?", {where.first, where.second});
            for (auto one = seen.begin(); done && one != seen.end(); ++one)
                done = db().execute("INSERT INTO followed VALUES (?, ?, ?, ?)",
                                    {where.first, where.second, static_cast<std::int64_t>(one->first),
                                     static_cast<std::int64_t>(one->second)});
            if (!done) return done.error();
        }
        for (const auto& [boat, sailed] : trips) {
            auto done = db().execute("UPDATE boat SET sailed_m = ? WHERE id = ?", {sailed, boat});
            if (!done) return done.error();
        }
        return {};
    });
    if (!kept) return kept;
    statistics.written += fixes.size() + packets.size();
    statistics.fixes += new_fixes;
    statistics.packets += new_packets;
    fixes.clear();
    packets.clear();
    heard.clear();
    for (auto& [where, seen] : cursors) written_cursors[where] = std::move(seen);
    cursors.clear();
    trips.clear();
    statistics.waiting = 0;
    return {};
}

ise::result<std::vector<archived_fix>> track_archive::fixes(const std::string& boat, utc_ms from, utc_ms until,
                                                            std::size_t max) {
    auto& db = self_->db();
    auto found = db.query("SELECT min(at), max(at), count(*) FROM fix WHERE boat = ? AND at >= ? AND at < ?",
                          {boat, archived(from), archived(until)});
    if (!found) return found.error();
    auto span = found->at(0).integer(1) - found->at(0).integer(0), count = found->at(0).integer(2);
    auto step = count <= static_cast<std::int64_t>(max)
                    ? std::int64_t{1}
                    : span / static_cast<std::int64_t>(std::max<std::size_t>(max, 1)) + 1;
    auto rows =
        db.query("SELECT min(at), latitude_deg, longitude_deg, speed_mps, course_deg, heading_deg, heel_deg, "
                 "wind_speed_mps, wind_direction_deg, "
                 "circular_error_m, link FROM fix WHERE boat = ? AND at >= ? AND at < ? GROUP BY at / ? ORDER BY at",
                 {boat, archived(from), archived(until), step});
    if (!rows) return rows.error();
    std::vector<archived_fix> all;
    all.reserve(rows->size());
    for (const auto& row : *rows) {
        archived_fix made;
        made.point.at = time_of(row.integer(0));
        made.point.latitude_deg = row.real(1);
        made.point.longitude_deg = row.real(2);
        std::optional<double>* values[] = {&made.point.speed_mps,       &made.point.course_deg,
                                           &made.point.heading_deg,     &made.point.heel_deg,
                                           &made.point.wind_speed_mps,  &made.point.wind_direction_deg,
                                           &made.point.circular_error_m};
        for (std::size_t i = 0; i < std::size(values); ++i) *values[i] = maybe(row, 3 + i);
        made.link = row.text(10);
        all.push_back(std::move(made));
    }
    return all;
}

ise::result<std::vector<telemetry_packet>> track_archive::telemetry(const std::string& boat, utc_ms from, utc_ms until,
                                                                    std::size_t max) {
    auto rows = self_->db().query(
        "SELECT boot, sequence, link, measured_at, received_at, history, raw FROM telemetry WHERE boat = ? "
        "AND measured_at >= ? AND measured_at < ? ORDER BY measured_at, boot, sequence, number LIMIT ?",
        {boat, archived(from), archived(until), static_cast<std::int64_t>(max)});
    if (!rows) return rows.error();
    std::vector<telemetry_packet> all;
    for (const auto& row : *rows) all.push_back(packet_of(row));
    return all;
}

ise::result<std::vector<telemetry_packet>> track_archive::newest(const std::string& boat) {
    std::vector<telemetry_packet> all;
    for (auto name : telemetry_kinds) {
        std::string kind(name);
        // Of one time the first, as on the page.
        auto rows =
            self_->db().query("SELECT boot, sequence, link, measured_at, received_at, history, raw FROM telemetry "
                              "WHERE boat = ? AND kind = ? ORDER BY shown_at DESC, number LIMIT ?",
                              {boat, kind, kind == "waypoints" ? newest_of_a_kind : 1});
        if (!rows) return rows.error();
        for (const auto& row : *rows) all.push_back(packet_of(row));
    }
    std::ranges::stable_sort(all, {}, [](const telemetry_packet& one) {
        return one.received_at > utc_time() ? std::min(one.measured_at, one.received_at) : one.measured_at;
    });
    return all;
}

ise::result<track_cursor> track_archive::cursor(const std::string& boat, const std::string& feed) {
    auto rows = self_->db().query("SELECT store, position FROM followed WHERE boat = ? AND feed = ?", {boat, feed});
    if (!rows) return rows.error();
    track_cursor seen;
    for (const auto& row : *rows)
        seen[static_cast<std::uint64_t>(row.integer(0))] = static_cast<std::uint64_t>(row.integer(1));
    return seen;
}

ise::result<double> track_archive::sailed_m(const std::string& boat) {
    auto rows = self_->db().query("SELECT sailed_m FROM boat WHERE id = ?", {boat});
    if (!rows) return rows.error();
    return rows->empty() ? 0 : rows->at(0).real(0);
}

ise::result<std::map<std::string, utc_ms>> track_archive::heard(const std::string& boat) {
    auto rows = self_->db().query("SELECT link, at FROM heard WHERE boat = ?", {boat});
    if (!rows) return rows.error();
    std::map<std::string, utc_ms> all;
    for (const auto& row : *rows) all[row.text(0)] = time_of(row.integer(1));
    return all;
}

} // namespace atirma
