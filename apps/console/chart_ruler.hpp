#pragma once
#include "chart_projection.hpp"

#include <optional>
#include <vector>

class QPainter;

namespace atirma::console {

/// Measures distances and bearings from place to place.
class chart_ruler {
public:
    bool on() const noexcept { return on_; }
    /// Begins without a place.
    void set(bool on);
    void add(const waypoint& place) { places_.push_back(place); }
    /// Removes the last place. False: there is none.
    bool take_back();
    /// With `pointer` as the last place.
    void paint(QPainter& to, const chart_projection& projection, const std::optional<QPointF>& pointer) const;

private:
    bool on_ = false;
    std::vector<waypoint> places_;
};

} // namespace atirma::console
