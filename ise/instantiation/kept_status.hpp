#pragma once
#include <ise/instantiation/machine.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace ise::instantiation {

/// What the keeper of a process (keeper.hpp) records beside its output: one record that is overwritten in place, so
/// that a full disk does not stop it.
struct kept_status {
    std::uint64_t base = 0;    ///< bytes printed before those in the output file
    std::uint64_t dropped = 0; ///< bytes that could not be written
    std::string trouble;       ///< why the output cannot be written now; empty: it can
    std::uint64_t life = 0;    ///< counts processes
    std::string mark;          ///< of the present one
    process_stamp process;     ///< 0: it is being started
    bool ended = false;
    process_end how;               ///< if it has ended
    std::uint64_t ended_at_ms = 0; ///< since the boot of the machine
};

/// Room for a record; each has exactly this size.
inline constexpr std::size_t kept_status_bytes = 1024;

/// `moving`: the output file is being replaced.
std::string kept_status_text(const kept_status& of, std::uint64_t sequence, bool moving);
/// Nothing: there is no record, it was being written, or the output file is being replaced.
std::optional<kept_status> read_kept_status(std::string_view text);

/// The record's file beside an output file.
inline std::string status_file_of(const std::string& output_file) { return output_file + ".status"; }
/// Where older output is.
inline std::string older_output_of(const std::string& output_file) { return output_file + ".1"; }

} // namespace ise::instantiation
