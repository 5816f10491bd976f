#pragma once
#include <string>
#include <vector>

namespace atirma {

struct coast_point {
    double latitude_deg = 0;
    double longitude_deg = 0;
};

/// A closed shoreline: land is inside.
struct coast_ring {
    std::string name;
    std::vector<coast_point> points;
};

/// A name on the chart.
struct coast_place {
    std::string name;
    coast_point at;
    bool sea = false;
};

/// The greatest ring first. Made once; thread-safe.
const std::vector<coast_ring>& coast_rings();
const std::vector<coast_place>& coast_places();
/// To be shown wherever the coast is.
const std::string& coast_attribution();

} // namespace atirma
