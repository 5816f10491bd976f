#pragma once
#include <components/web_server/track_updates.hpp>

#include <array>
#include <cstdint>
#include <string_view>

namespace atirma {

/// README.md tells what stands in the columns. Steps are only ever appended: files of older programs take the rest.
inline constexpr std::array<std::string_view, 2> archive_schema = {R"sql(
CREATE TABLE boat (
    id TEXT PRIMARY KEY, name TEXT NOT NULL, sailed_m REAL NOT NULL DEFAULT 0, thinned_until INTEGER NOT NULL DEFAULT 0
) WITHOUT ROWID;
CREATE TABLE fix (
    boat TEXT NOT NULL REFERENCES boat, at INTEGER NOT NULL,
    latitude_deg REAL NOT NULL, longitude_deg REAL NOT NULL, speed_mps REAL, course_deg REAL, heading_deg REAL, heel_deg REAL,
    wind_speed_mps REAL, wind_direction_deg REAL, circular_error_m REAL, link TEXT NOT NULL,
    PRIMARY KEY (boat, at)
) WITHOUT ROWID;
CREATE TABLE telemetry (
    boat TEXT NOT NULL REFERENCES boat, boot INTEGER NOT NULL, sequence INTEGER NOT NULL, link INTEGER NOT NULL,
    kind TEXT NOT NULL, measured_at INTEGER NOT NULL, received_at INTEGER NOT NULL, history INTEGER NOT NULL, raw BLOB NOT NULL,
    PRIMARY KEY (boat, boot, sequence)
) WITHOUT ROWID;
CREATE INDEX telemetry_by_kind ON telemetry (boat, kind, measured_at);
CREATE INDEX telemetry_by_time ON telemetry (boat, measured_at);
CREATE TABLE heard (boat TEXT NOT NULL REFERENCES boat, link TEXT NOT NULL, at INTEGER NOT NULL, PRIMARY KEY (boat, link)) WITHOUT ROWID;
CREATE TABLE followed (
    boat TEXT NOT NULL REFERENCES boat, feed TEXT NOT NULL, store INTEGER NOT NULL, position INTEGER NOT NULL,
    PRIMARY KEY (boat, feed, store)
) WITHOUT ROWID;
CREATE VIEW track AS SELECT
    boat, strftime('%Y-%m-%dT%H:%M:%fZ', at / 1000.0, 'unixepoch') AS utc, latitude_deg, longitude_deg,
    round(speed_mps * 3600 / 1852, 2) AS speed_kn, course_deg, heading_deg, heel_deg,
    round(wind_speed_mps * 3600 / 1852, 2) AS wind_kn, wind_direction_deg, circular_error_m, link
    FROM fix
)sql", // The content belongs to a packet's identity. `number`: in the order in which they came. `shown_at`: as the page dates it.
                                                                   R"sql(
CREATE TABLE telemetry_by_content (
    number INTEGER PRIMARY KEY, boat TEXT NOT NULL REFERENCES boat, boot INTEGER NOT NULL, sequence INTEGER NOT NULL,
    link INTEGER NOT NULL, kind TEXT NOT NULL, measured_at INTEGER NOT NULL, received_at INTEGER NOT NULL,
    history INTEGER NOT NULL, raw BLOB NOT NULL,
    shown_at INTEGER AS (iif(received_at > 0, min(measured_at, received_at), measured_at)) VIRTUAL,
    UNIQUE (boat, boot, sequence, raw)
);
INSERT INTO telemetry_by_content (boat, boot, sequence, link, kind, measured_at, received_at, history, raw)
    SELECT boat, boot, sequence, link, kind, measured_at, received_at, history, raw FROM telemetry ORDER BY received_at;
DROP TABLE telemetry;
ALTER TABLE telemetry_by_content RENAME TO telemetry;
CREATE INDEX telemetry_by_kind ON telemetry (boat, kind, shown_at);
CREATE INDEX telemetry_by_time ON telemetry (boat, measured_at)
)sql"};

/// How a time stands in the columns: milliseconds since 1970, UTC.
inline std::int64_t archived(utc_ms at) { return at.time_since_epoch().count(); }

} // namespace atirma
