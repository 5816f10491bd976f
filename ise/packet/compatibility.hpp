#pragma once
#include <ise/packet/schema.hpp>

#include <optional>
#include <string>

namespace ise {

/// Whether `reader` can decode packets of `writer`: empty if so, else a diff for people with one line per difference
/// (`waypoints[].latitude_deg: reader f64, writer f32`).
/// Compatible are fields, enumerators and alternatives appended on either side, at any depth, also in containers.
std::optional<std::string> incompatibility(const schema& reader, const schema& writer);

} // namespace ise
