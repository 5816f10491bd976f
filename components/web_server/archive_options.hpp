#pragma once
#include <chrono>
#include <cstdint>
#include <string>

namespace atirma {

/// What is kept, and for how long. README.md has the schema.
struct archive_options {
    std::string file;                        ///< of SQLite; "memory:NAME" is a virtual disk; empty: nothing is kept
    std::chrono::hours keep_fixes{24 * 365}; ///< older ones are deleted
    std::chrono::hours keep_whole{24 * 7};   ///< of older fixes one a `coarse` stays
    std::chrono::seconds coarse{60};
    std::chrono::hours keep_telemetry{24 * 30}; ///< older packets are deleted, but for the newest of each kind
    std::size_t max_rows = 3'000'000; ///< of fixes, and of telemetry, all boats together: beyond it the oldest go
    std::size_t max_waiting = 50'000; ///< rows in memory while the disk takes none; beyond it the oldest are given up
};

/// Counted since it was opened, but for the numbers of rows.
struct archive_statistics {
    std::uint64_t fixes = 0, packets = 0; ///< rows on disk now
    std::uint64_t written = 0, removed = 0;
    std::uint64_t waiting = 0;  ///< rows that are not on disk yet
    std::uint64_t given_up = 0; ///< see max_waiting
    std::uint64_t failed_commits = 0;
    std::uint64_t begun_anew = 0; ///< the file was damaged, and set aside
    std::string trouble;          ///< why the last commit failed; empty: it did not
};

} // namespace atirma
