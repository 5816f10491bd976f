#include "chart_ruler.hpp"

#include "chart_furniture.hpp"
#include "theme.hpp"
#include "units.hpp"

#include <components/gui_client/mission.hpp>

#include <QObject>
#include <QPainter>

namespace atirma::console {

void chart_ruler::set(bool on) {
    on_ = on;
    places_.clear();
}

bool chart_ruler::take_back() {
    if (!on_ || places_.empty()) return false;
    places_.pop_back();
    return true;
}

void chart_ruler::paint(QPainter& to, const chart_projection& projection, const std::optional<QPointF>& pointer) const {
    if (!on_) return;
    const auto& t = colours();
    QPolygonF line;
    for (const auto& p : places_) line << projection.to_pixels(p);
    if (pointer && !places_.empty()) line << *pointer;
    to.setPen(QPen(t.accent, 1.8));
    to.setBrush(Qt::NoBrush);
    to.drawPolyline(line);
    to.setBrush(t.accent);
    double sum = 0, last = 0, bearing = 0;
    for (int i = 0; i < line.size(); ++i) {
        to.drawEllipse(line[i], 3, 3);
        if (i == 0) continue;
        auto a = projection.to_place(line[i - 1]), b = projection.to_place(line[i]);
        last = distance_m(a, b);
        bearing = bearing_deg(a, b);
        sum += last;
    }
    QString words = QObject::tr("Measure: click from place to place, Esc ends");
    if (line.size() > 1) {
        words = QStringLiteral("%1  %2°").arg(distance_text(last)).arg(bearing, 3, 'f', 0, QLatin1Char('0'));
        if (line.size() > 2) words += QObject::tr("   in all %1").arg(distance_text(sum));
    }
    to.setFont(font_of(12, QFont::DemiBold));
    paint_note(to, QPointF(10, 24), 26, words, t.accent);
}

} // namespace atirma::console
