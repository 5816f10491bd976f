#include "chart_base.hpp"

#include "theme.hpp"

#include <components/coast/coast.hpp>

#include <QPainter>
#include <QPainterPath>

#include <array>

namespace atirma::console {
namespace {

/// Minutes of arc between two lines, so that they lie some hundred pixels apart.
double graticule_minutes(double pixels_per_degree) {
    for (double minutes : {0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0})
        if (minutes / 60 * pixels_per_degree >= 110) return minutes;
    return 600;
}

QString line_text(double degrees, QChar positive, QChar negative, double step_minutes) {
    double all = std::abs(degrees) * 60;
    int digits = step_minutes >= 1 ? 0 : step_minutes >= 0.1 ? 1 : 2;
    auto whole = std::floor((all + 1e-6) / 60);
    return QStringLiteral("%1° %2′ %3")
        .arg(whole, 0, 'f', 0)
        .arg(std::max(0.0, all - whole * 60), digits + (digits ? 3 : 2), 'f', digits, QLatin1Char('0'))
        .arg(degrees < 0 ? negative : positive);
}

void haloed_text(QPainter& to, QPointF at, const QString& text, const QColor& ink, const QColor& halo) {
    QPainterPath path;
    path.addText(at, to.font(), text);
    to.setPen(QPen(halo, 3, Qt::SolidLine, Qt::RoundCap, Qt::RoundJoin));
    to.setBrush(Qt::NoBrush);
    to.drawPath(path);
    to.fillPath(path, ink);
}

} // namespace

const QPixmap& chart_base::picture(const chart_projection& projection, double pixel_ratio) {
    if (painted_ == projection && picture_.devicePixelRatio() == pixel_ratio) return picture_;
    painted_ = projection;
    picture_ = QPixmap((projection.size * pixel_ratio).toSize());
    picture_.setDevicePixelRatio(pixel_ratio);
    picture_.fill(colours().sea);
    QPainter to(&picture_);
    to.setRenderHint(QPainter::Antialiasing);
    paint_land(to, projection);
    paint_places(to, projection);
    return picture_;
}

void chart_base::paint_land(QPainter& to, const chart_projection& projection) {
    const auto& t = colours();
    QPainterPath land;
    QRectF near = QRectF(QPointF(), projection.size).adjusted(-400, -400, 400, 400);
    for (const auto& ring : coast_rings()) {
        QPolygonF outline;
        outline.reserve(static_cast<int>(ring.points.size()));
        for (const auto& p : ring.points) outline << projection.to_pixels({p.latitude_deg, p.longitude_deg});
        if (!outline.boundingRect().intersects(near)) continue;
        land.addPolygon(outline);
        land.closeSubpath();
    }
    for (auto [wide, colour] :
         std::array<std::pair<double, QColor>, 3>{{{46, t.shore3}, {28, t.shore2}, {13, t.shore1}}}) {
        to.setPen(QPen(colour, wide, Qt::SolidLine, Qt::RoundCap, Qt::RoundJoin));
        to.drawPath(land);
    }
    paint_graticule(to, projection, false);
    to.setPen(QPen(t.coast, 1.3));
    to.setBrush(t.land);
    to.drawPath(land);
    paint_graticule(to, projection, true);
}

void chart_base::paint_places(QPainter& to, const chart_projection& projection) {
    const auto& t = colours();
    for (const auto& place : coast_places()) {
        if (place.name == "Gran Canaria" ? projection.metres_per_pixel < 25 : projection.metres_per_pixel > 30)
            continue;
        auto font = font_of(place.sea ? 13 : 12, QFont::Medium);
        font.setItalic(place.sea);
        font.setLetterSpacing(QFont::AbsoluteSpacing, place.sea ? 1.6 : 0.4);
        to.setFont(font);
        auto label = text(place.name);
        auto at = projection.to_pixels({place.at.latitude_deg, place.at.longitude_deg});
        at.rx() -= QFontMetricsF(font).horizontalAdvance(label) / 2;
        haloed_text(to, at, label, place.sea ? t.sea_text : t.place, place.sea ? t.sea : t.land);
    }
}

void chart_base::paint_graticule(QPainter& to, const chart_projection& projection, bool numbers) {
    const auto& t = colours();
    double width = projection.size.width(), height = projection.size.height();
    double minutes = graticule_minutes(projection.pixels_per_degree());
    double step = minutes / 60;
    auto corner = projection.to_place({0, height});
    auto other = projection.to_place({width, 0});
    to.setFont(font_of(10));
    to.setPen(numbers ? QPen(t.sea_text) : QPen(t.graticule, 1));
    double east = other.longitude_deg < corner.longitude_deg ? other.longitude_deg + 360 : other.longitude_deg; // 180°
    for (double lon = std::ceil(corner.longitude_deg / step) * step; lon < east; lon += step) {
        double x = std::round(projection.to_pixels({corner.latitude_deg, lon}).x()) + 0.5;
        if (!numbers) to.drawLine(QPointF(x, 0), QPointF(x, height));
        else if (x < width - 80)
            to.drawText(QPointF(x + 4, 12), line_text(std::remainder(lon, 360), 'E', 'W', minutes));
    }
    for (double lat = std::ceil(corner.latitude_deg / step) * step; lat < other.latitude_deg; lat += step) {
        double y = std::round(projection.to_pixels({lat, corner.longitude_deg}).y()) + 0.5;
        if (!numbers) to.drawLine(QPointF(0, y), QPointF(width, y));
        else if (y > 60 && y < height - 60) // legend and scale lie beyond
            to.drawText(QRectF(0, y - 16, width - 7, 14), Qt::AlignRight | Qt::AlignBottom,
                        line_text(lat, 'N', 'S', minutes));
    }
}

} // namespace atirma::console
