#include <components/web_server/archive_retention.hpp>

#include <components/web_server/archive_schema.hpp>

#include <algorithm>

namespace atirma {
namespace {

constexpr std::int64_t slice = 1000; // rows that go at once: nobody waits for long

} // namespace

ise::result<void> archive_retention::remove(std::uint64_t& rows, std::string_view sql, ise::database::values bound) {
    auto done = db.execute(sql, bound);
    if (!done) return done.error();
    auto gone = static_cast<std::uint64_t>(*done);
    statistics.removed += gone;
    rows -= std::min(rows, gone);
    return {};
}

ise::result<void> archive_retention::tidy(utc_ms now) {
    auto boats = db.query("SELECT id FROM boat"); // also of those that are shown no more
    if (!boats) return boats.error();
    for (const auto& row : *boats) {
        auto boat = row.text(0);
        auto gone = remove(statistics.fixes,
                           "DELETE FROM fix WHERE boat = ?1 AND at IN (SELECT at FROM fix WHERE boat = ?1 AND at < ?2 "
                           "ORDER BY at LIMIT ?3)",
                           {boat, archived(now - options.keep_fixes), slice});
        if (gone) gone = drop_telemetry(boat, now - options.keep_telemetry);
        if (gone) gone = thin(boat, now - options.keep_whole);
        if (!gone) return gone;
    }
    if (statistics.fixes > options.max_rows)
        if (auto gone = drop_surplus("fix"); !gone) return gone;
    if (statistics.packets > options.max_rows)
        if (auto gone = drop_surplus("telemetry"); !gone) return gone;
    return {};
}

/// Of the next hour of whole fixes that is old enough, the first of each minute stays.
ise::result<void> archive_retention::thin(const std::string& boat, utc_ms before) {
    auto from = db.query(
        "SELECT min(at) FROM fix WHERE boat = ?1 AND at >= (SELECT thinned_until FROM boat WHERE id = ?1)", {boat});
    if (!from) return from.error();
    if (from->at(0).is_null(0)) return {};
    constexpr std::int64_t hour = 3'600'000;
    auto begin = from->at(0).integer(0) / hour * hour, end = begin + hour,
         step = std::chrono::milliseconds(options.coarse).count();
    if (end > archived(before)) return {};
    auto gone =
        remove(statistics.fixes,
               "DELETE FROM fix WHERE boat = ?1 AND at >= ?2 AND at < ?3 AND circular_error_m IS NULL AND at NOT IN "
               "(SELECT min(at) FROM fix WHERE boat = ?1 AND at >= ?2 AND at < ?3 AND circular_error_m IS NULL GROUP "
               "BY at / ?4)",
               {boat, begin, end, step});
    if (!gone) return gone;
    auto done = db.execute("UPDATE boat SET thinned_until = ? WHERE id = ?", {end, boat});
    if (!done) return done.error();
    return {};
}

ise::result<void> archive_retention::drop_telemetry(const std::string& boat, utc_ms before) {
    for (auto name : telemetry_kinds) {
        std::string kind(name);
        auto gone =
            remove(statistics.packets,
                   "DELETE FROM telemetry WHERE number IN (SELECT number FROM telemetry WHERE boat = ?1 AND kind = ?2 "
                   "AND shown_at < min(?3, coalesce((SELECT shown_at FROM telemetry WHERE boat = ?1 AND kind = ?2 "
                   "ORDER BY shown_at DESC LIMIT 1 OFFSET ?4), 0)) ORDER BY shown_at LIMIT ?5)",
                   {boat, kind, archived(before), newest_of_a_kind - 1, slice});
        if (!gone) return gone;
    }
    return {};
}

/// The oldest of the boat that has the oldest.
ise::result<void> archive_retention::drop_surplus(std::string_view table) {
    if (table == "fix") {
        auto oldest =
            db.query("SELECT id FROM boat ORDER BY coalesce((SELECT min(at) FROM fix WHERE boat = id), 9e18) LIMIT 1");
        if (!oldest) return oldest.error();
        return remove(
            statistics.fixes,
            "DELETE FROM fix WHERE boat = ?1 AND at IN (SELECT at FROM fix WHERE boat = ?1 ORDER BY at LIMIT ?2)",
            {oldest->at(0).text(0), std::min(slice, static_cast<std::int64_t>(statistics.fixes - options.max_rows))});
    }
    auto oldest = db.query("SELECT id FROM boat ORDER BY coalesce((SELECT min(measured_at) FROM telemetry WHERE boat = "
                           "id), 9e18) LIMIT 1");
    if (!oldest) return oldest.error();
    return remove(
        statistics.packets,
        "DELETE FROM telemetry WHERE number IN (SELECT number FROM telemetry WHERE boat = ?1 "
        "ORDER BY measured_at LIMIT ?2)",
        {oldest->at(0).text(0), std::min(slice, static_cast<std::int64_t>(statistics.packets - options.max_rows))});
}

} // namespace atirma
