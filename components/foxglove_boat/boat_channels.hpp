#pragma once
#include <components/foxglove_gateway/derived_channels.hpp>

#include <memory>
#include <string>

namespace atirma {

/// Channels of a `telemetry` service (components/boat/services.hpp), below the path of its component; null for any
/// other service. Positions of the 3D frames are metres east and north of the first fix.
///
/// | topic | schema | |
/// |---|---|---|
/// | `fix` | foxglove.LocationFix | the newest position, with heading, speed and course |
/// | `attitude` | foxglove.FrameTransform | frame `boat` in `map`: position, heading, heel, pitch |
/// | `wind_frame` | foxglove.FrameTransform | frame `wind` in `map`, at the boat: x is where the wind blows to |
/// | `track` | foxglove.GeoJSON | the last positions as a line |
/// | `location`, `navigation`, `wind`, `power` | ise.location … | the newest report of each kind, field by field |
std::unique_ptr<ise::foxglove::derivation> boat_channels(const std::string& component,
                                                         const ise::dynamic_contract& service);

} // namespace atirma
