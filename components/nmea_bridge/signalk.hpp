#pragma once
#include <components/boat/newest_reports.hpp>

#include <string>

// Signal K deltas, one JSON object a line, in SI units and radians as its specification wants them. Pure.
namespace atirma::signalk {

/// The identity of a vessel: `urn:mrn:signalk:uuid:…`, of a UUID (version 4, in lower case), or else made from its
/// name, the same each time.
std::string identity(const std::string& name, const std::string& uuid);
/// Whether it is a UUID that Signal K takes.
bool is_uuid(const std::string& text) noexcept;
/// What a server says first to who connects.
std::string hello(const std::string& identity, utc_time now);
/// The vessel's name, and units and meaning of the paths that the specification does not define.
std::string about(const std::string& name, utc_time now);

std::string position(const heard<location>& at);
std::string attitude(const heard<navigation>& how);
std::string wind_of(const heard<wind>& what, const std::optional<heard<navigation>>& heading);
std::string battery(const heard<power>& what);
/// A link as the boat sees it, below `communication.links`, with the names that the packet has.
std::string link_of(const heard<link_status>& how);
/// The position is not known any more: null.
std::string no_position(utc_time now);

} // namespace atirma::signalk
