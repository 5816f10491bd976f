#pragma once
#include <components/boat/newest_reports.hpp>

#include <string>
#include <string_view>

// NMEA 0183 sentences, each with its checksum and line end. Pure.
namespace atirma::nmea {

/// "GPHDT,12.3,T" → "$GPHDT,12.3,T*hh\r\n".
std::string sentence(std::string_view content);
/// The XOR of all between '$' and '*'.
unsigned checksum(std::string_view content) noexcept;

/// RMC, GGA and VTG of a fix, with the time of its measurement.
std::string position(const heard<location>& at);
/// RMC with status V and GGA without a fix: there is no position that holds now.
std::string no_position(utc_time now);
/// HDT, RSA (to starboard positive) and XDR with heel and pitch.
std::string attitude(const heard<navigation>& how);
/// MWV apparent; true too where the heading is known, from the bow as the sentence wants it.
std::string wind_of(const heard<wind>& what, const std::optional<heard<navigation>>& heading);
/// XDR of the battery: volts and amperes, out of it positive.
std::string battery(const heard<power>& what);

} // namespace atirma::nmea
