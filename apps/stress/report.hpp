#pragma once
#include "findings.hpp"

#include <filesystem>
#include <string>

namespace atirma::stress {

/// report.md: the same run gives the same text, byte for byte, whatever machine and compiler.
std::string make_report(const account& of, const findings& found, const ledger::verdict& proof);
/// Whether everything is proved: nothing lost, nothing shown twice, and the page counts the same.
bool holds(const account& of, const ledger::verdict& proof);

/// In words, whether something that was counted over time grows: over the last half never more than a little above the
/// first half, which had all kinds of trouble as well.
std::string flatness(const std::vector<std::size_t>& all);

/// track.svg: the track coloured by link, on the coast; below it, when each link and each server was there.
std::string make_picture(const account& of, const findings& found);
/// track.gpx: the course and every fix.
std::string make_gpx(const findings& found);

/// A file of the report, whole. Throws std::runtime_error where it cannot be written, with what may be the reason.
void write_file(const std::filesystem::path& file, const std::string& content);

} // namespace atirma::stress
