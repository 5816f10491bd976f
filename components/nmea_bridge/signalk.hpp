#pragma once
#include <components/boat/newest_reports.hpp>

#include <string>

// Signal K deltas, one JSON object a line, in SI units and radians as its specification wants them. Pure.
namespace atirma::signalk {

std::string position(const dated<location>& at);
std::string attitude(const dated<navigation>& how);
std::string wind_of(const dated<wind>& what, const std::optional<dated<navigation>>& heading);
std::string battery(const dated<power>& what);
/// A link as the boat sees it, below `communication.links`, with the names that the packet has.
std::string link_of(const dated<link_status>& how);
/// The position is not known any more: null.
std::string no_position(utc_time now);

} // namespace atirma::signalk
