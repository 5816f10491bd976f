#pragma once
#include <components/web_server/track_archive.hpp>
#include <components/web_server/track_state.hpp>
#include <ise/http/http_server.hpp>

#include <functional>
#include <string>
#include <string_view>

namespace atirma {

/// What one boat has to download, under `prefix` ("" or "/vela"): track.gpx, track.kml, track.csv, track.geojson and
/// telemetry.ndjson; see README.md. `?from=` and `?until=` (ISO 8601 or milliseconds) choose a time; a bad one is a
/// 400. With an archive (not null) everything that it keeps, thinned to 20000 fixes, else what the page shows. The same
/// download is made once in ten seconds, however many ask, and after one from an archive that took more than 250 ms
/// those of all boats are a 503 for four times as long: those who watch come first. `state` and `archive` outlive the
/// server.
void offer_downloads(ise::http_server& server, const std::string& prefix, const track_state& state,
                     track_archive* archive, std::function<utc_ms()> clock);

/// The value of `name` in a query, decoded; empty where it is missing.
std::string query_value(std::string_view query, std::string_view name);
/// "2026-11-21T10:00:00Z" (or with a space, without seconds, or only the day) or milliseconds since 1970.
std::optional<utc_ms> parse_time(std::string_view text);

} // namespace atirma
