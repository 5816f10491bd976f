#include "chart_view.hpp"
#include "theme.hpp"

#include <components/coast/coast.hpp>
#include <components/gui_client/freshness.hpp>
#include <components/gui_client/mission.hpp>
#include <components/gui_client/words.hpp>

#include <QPainter>
#include <QPainterPath>

#include <map>

// What lies over the chart: scale, legend, pointer, what is measured, and words where there is no boat yet.
namespace atirma::console {
namespace {

void panel(QPainter& to, const QRectF& box) {
    QColor back = colours().card;
    back.setAlpha(225);
    to.setPen(QPen(colours().line, 1));
    to.setBrush(back);
    to.drawRoundedRect(box, 7, 7);
}

} // namespace

void chart_view::paint_scale(QPainter& to) const {
    const auto& t = colours();
    double room = 150 * projection_.metres_per_pixel;
    double step = std::pow(10, std::floor(std::log10(room)));
    for (double many : {5.0, 2.0})
        if (many * step <= room) {
            step *= many;
            break;
        }
    double length = step / projection_.metres_per_pixel;
    QPointF at(width() - length - 18, height() - 20);
    to.setPen(QPen(t.card, 4));
    to.drawLine(at, at + QPointF(length, 0));
    to.setPen(QPen(t.ink2, 2));
    to.drawPolyline(QPolygonF({at + QPointF(0, -5), at, at + QPointF(length, 0), at + QPointF(length, -5)}));
    to.setFont(font_of(11, QFont::DemiBold));
    to.setPen(t.ink2);
    auto words = step >= 1000 ? QStringLiteral("%1 km").arg(step / 1000) : QStringLiteral("%1 m").arg(step);
    to.drawText(QRectF(at.x(), at.y() - 21, length, 15), Qt::AlignCenter, words);
    to.setFont(font_of(9));
    to.setPen(t.ink3);
    to.drawText(QRectF(width() - 330, height() - 15, 322, 13), Qt::AlignRight | Qt::AlignVCenter,
                text(coast_attribution()));
}

// The links by the colour of their track, and when the boat was heard over each: a lost one shows at once.
void chart_view::paint_legend(QPainter& to) const {
    if (!seen_) return;
    const auto& t = colours();
    struct part {
        QColor line, age_ink;
        QString name, age;
    };
    std::map<link_id, part> parts;
    bool history = false;
    for (const auto& p : *seen_->track) {
        parts[p.link].name = text(label(p.link));
        history = history || p.history;
    }
    for (const auto& link : seen_->links) {
        if (link.all_links || !link.link) continue;
        auto& one = parts[*link.link];
        one.name = text(label(*link.link));
        one.age = link.last_heard ? text(age_text(age_s(now_, *link.last_heard))) : tr("not heard");
        auto how = !link.last_heard ? freshness::none
                                    : judge(age_s(now_, *link.last_heard),
                                            expected_period_s(value_kind::position, *link.link, seen_->boat.settings));
        one.age_ink = t.of(how);
    }
    if (parts.empty()) return;
    for (auto& [link, one] : parts) one.line = t.of(link);
    to.setFont(font_of(11));
    QFontMetricsF metrics(to.font());
    auto later = tr("told later");
    double wide = 8;
    for (const auto& [link, one] : parts)
        wide += 24 + metrics.horizontalAdvance(one.name) + metrics.horizontalAdvance(one.age) + 5 + 14;
    if (history) wide += 24 + metrics.horizontalAdvance(later) + 12;
    QRectF box(width() - wide - 10, 20, wide, 24);
    panel(to, box);
    double x = box.left() + 10;
    auto say = [&](const QString& words, const QColor& ink) {
        to.setPen(ink);
        to.drawText(QRectF(x, box.top(), 200, box.height()), Qt::AlignVCenter, words);
        x += metrics.horizontalAdvance(words);
    };
    for (const auto& [link, one] : parts) {
        to.setPen(QPen(one.line, 3, Qt::SolidLine, Qt::RoundCap));
        to.drawLine(QPointF(x, box.center().y()), QPointF(x + 17, box.center().y()));
        x += 24;
        say(one.name, t.ink2);
        x += 5;
        say(one.age, one.age_ink);
        x += 14;
    }
    if (!history) return;
    to.setPen(QPen(t.ink3, 2, Qt::DotLine));
    to.drawLine(QPointF(x, box.center().y()), QPointF(x + 17, box.center().y()));
    x += 24;
    say(later, t.ink2);
}

void chart_view::paint_pointer(QPainter& to) const {
    QString words;
    auto at = boat_place();
    if (pointer_) {
        auto place = projection_.to_place(*pointer_);
        words = place_text(place);
        if (at)
            words += QStringLiteral("   ·   %1  %2 %3°")
                         .arg(tr("from the boat"), distance_text(distance_m(*at, place)))
                         .arg(bearing_deg(*at, place), 3, 'f', 0, QLatin1Char('0'));
    } else if (at) {
        words = place_text(*at);
    } else {
        return;
    }
    if (edit_ && !pressed_at_) words += "   ·   " + tr("click adds, drag moves, Del removes");
    to.setFont(font_of(11));
    QFontMetricsF metrics(to.font());
    QRectF box(10, height() - 33, metrics.horizontalAdvance(words) + 20, 24);
    panel(to, box);
    to.setPen(colours().ink2);
    to.drawText(box, Qt::AlignCenter, words);
}

void chart_view::paint_measure(QPainter& to) const {
    if (!measure_) return;
    const auto& t = colours();
    QPolygonF line;
    for (const auto& p : measured_) line << projection_.to_pixels(p);
    if (pointer_ && !measured_.empty()) line << *pointer_;
    to.setPen(QPen(t.accent, 1.8));
    to.setBrush(Qt::NoBrush);
    to.drawPolyline(line);
    to.setBrush(t.accent);
    double sum = 0, last = 0, bearing = 0;
    for (int i = 0; i < line.size(); ++i) {
        to.drawEllipse(line[i], 3, 3);
        if (i == 0) continue;
        auto a = projection_.to_place(line[i - 1]), b = projection_.to_place(line[i]);
        last = distance_m(a, b);
        bearing = bearing_deg(a, b);
        sum += last;
    }
    QString words = tr("Measure: click from place to place, Esc ends");
    if (line.size() > 1) {
        words = QStringLiteral("%1  %2°").arg(distance_text(last)).arg(bearing, 3, 'f', 0, QLatin1Char('0'));
        if (line.size() > 2) words += tr("   in all %1").arg(distance_text(sum));
    }
    to.setFont(font_of(12, QFont::DemiBold));
    QRectF box(10, 24, QFontMetricsF(to.font()).horizontalAdvance(words) + 20, 26);
    panel(to, box);
    to.setPen(t.accent);
    to.drawText(box, Qt::AlignCenter, words);
}

void chart_view::paint_empty(QPainter& to) const {
    const auto& t = colours();
    QString head = tr("No boat heard yet"), what, more;
    if (seen_) {
        const auto& f = seen_->finding;
        what = tr("Looking for %1").arg(text(f.looking_for));
        if (!f.where.empty()) what += tr(" at %1").arg(text(f.where));
        if (f.uses_names && !f.reached)
            more = f.trouble.empty() ? tr("Asking the name server…")
                                     : tr("The name server is not reached; it is tried again");
        else if (seen_->links.empty()) more = tr("No link to a boat is running yet; it is found as soon as it starts");
        else
            more = tr("%n link(s) found; waiting for the first packet", nullptr, static_cast<int>(seen_->links.size()));
    }
    QRectF box(width() / 2.0 - 200, height() / 2.0 - 62, 400, 124);
    panel(to, box);
    to.setPen(t.ink);
    to.setFont(font_of(19, QFont::DemiBold));
    to.drawText(box.adjusted(16, 18, -16, -74), Qt::AlignCenter, head);
    to.setFont(font_of(12));
    to.setPen(t.ink2);
    to.drawText(box.adjusted(16, 50, -16, -36), Qt::AlignCenter | Qt::TextWordWrap, what);
    to.setPen(t.ink3);
    to.drawText(box.adjusted(16, 84, -16, -12), Qt::AlignCenter | Qt::TextWordWrap, more);
}

} // namespace atirma::console
