#pragma once
#include <components/boat/telemetry.hpp>
#include <components/web_server/archive_options.hpp>
#include <components/web_server/track_updates.hpp>

#include <ise/database/database.hpp>

#include <array>
#include <string_view>
#include <utility>

namespace atirma {

/// "location", "navigation", …: the kinds of telemetry, in their order.
inline const auto telemetry_kinds = []<std::size_t... I>(std::index_sequence<I...>) {
    return std::array{name_of(telemetry_body(std::in_place_index<I>))...};
}
(std::make_index_sequence<std::variant_size_v<telemetry_body>>());

/// So many packets of each kind stay, however old: a long list of waypoints comes in several.
inline constexpr std::int64_t newest_of_a_kind = 64;

/// Takes out of an archive what is too old or too much, a slice at a time.
struct archive_retention {
    const archive_options& options;
    ise::database& db;
    archive_statistics& statistics;

    /// Errors: io_failed.
    ise::result<void> tidy(utc_ms now);

private:
    ise::result<void> thin(const std::string& boat, utc_ms before);
    ise::result<void> drop_telemetry(const std::string& boat, utc_ms before);
    ise::result<void> drop_surplus(std::string_view table);
    /// Runs a statement that deletes, and counts.
    ise::result<void> remove(std::uint64_t& rows, std::string_view sql, ise::database::values bound);
};

} // namespace atirma
