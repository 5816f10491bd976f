#pragma once
#include "chart_projection.hpp"

#include <QPixmap>

#include <optional>

class QPainter;

namespace atirma::console {

/// What changes only when the chart is moved: sea, coast, graticule and names, painted once and kept.
class chart_base {
public:
    /// Of the projection's size; valid until the next call.
    const QPixmap& picture(const chart_projection& projection, double pixel_ratio);
    /// Paints it again, since the colours have changed.
    void invalidate() { painted_.reset(); }

private:
    static void paint_land(QPainter& to, const chart_projection& projection);
    static void paint_places(QPainter& to, const chart_projection& projection);
    /// The lines, or their numbers, which lie over the land.
    static void paint_graticule(QPainter& to, const chart_projection& projection, bool numbers);

    QPixmap picture_;
    std::optional<chart_projection> painted_;
};

} // namespace atirma::console
