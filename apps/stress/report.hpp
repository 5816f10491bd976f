#pragma once
#include "findings.hpp"

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace atirma::stress {

/// report.md: the same run gives the same text, byte for byte, whatever machine and compiler.
std::string make_report(const account& of, const findings& found, const ledger::verdict& proof);
/// Whether everything is proved: nothing lost, nothing shown twice, and the page counts the same.
bool holds(const account& of, const ledger::verdict& proof);

/// How something that was counted over time changes: the line by least squares through the second half of the time.
struct trend {
    static constexpr double max_rise = 0.05; ///< of the mean, within that half; above, it is not flat
    double mean = 0, per_hour = 0;
    double rise = 0; ///< from the beginning of that half to its end, as a part of the mean
    bool flat() const noexcept { return rise <= max_rise; }
};
trend trend_of(const std::vector<std::pair<ise::duration, std::size_t>>& all);
/// The same in words. What flat means is said by `meaning_of_flat`.
std::string say(const trend& found);
std::string meaning_of_flat();

/// track.svg: the track coloured by link, on the coast; below it, when each link and each server was there.
std::string make_picture(const account& of, const findings& found);
/// track.gpx: the course and every fix.
std::string make_gpx(const findings& found);

/// A file of the report, whole. Throws std::runtime_error where it cannot be written, with what may be the reason.
void write_file(const std::filesystem::path& file, std::string_view content);

} // namespace atirma::stress
