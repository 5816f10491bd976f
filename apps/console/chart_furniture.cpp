#include "chart_furniture.hpp"

#include "theme.hpp"
#include "units.hpp"

#include <components/coast/coast.hpp>
#include <components/gui_client/freshness.hpp>
#include <components/gui_client/mission.hpp>
#include <components/gui_client/words.hpp>

#include <QObject>
#include <QPainter>
#include <QPainterPath>

#include <map>

namespace atirma::console {

void paint_panel(QPainter& to, const QRectF& box) {
    QColor back = colours().card;
    back.setAlpha(225);
    to.setPen(QPen(colours().line, 1));
    to.setBrush(back);
    to.drawRoundedRect(box, 7, 7);
}

void paint_note(QPainter& to, QPointF at, double height, const QString& words, const QColor& ink) {
    QRectF box(at.x(), at.y(), QFontMetricsF(to.font()).horizontalAdvance(words) + 20, height);
    paint_panel(to, box);
    to.setPen(ink);
    to.drawText(box, Qt::AlignCenter, words);
}

void paint_scale(QPainter& to, const chart_projection& projection) {
    double width = projection.size.width(), height = projection.size.height();
    const auto& t = colours();
    double room = 150 * projection.metres_per_pixel;
    double step = std::pow(10, std::floor(std::log10(room)));
    for (double many : {5.0, 2.0})
        if (many * step <= room) {
            step *= many;
            break;
        }
    double length = step / projection.metres_per_pixel;
    QPointF at(width - length - 18, height - 24);
    to.setPen(QPen(t.card, 4));
    to.drawLine(at, at + QPointF(length, 0));
    to.setPen(QPen(t.ink2, 2));
    to.drawPolyline(QPolygonF({at + QPointF(0, -5), at, at + QPointF(length, 0), at + QPointF(length, -5)}));
    to.setFont(font_of(11, QFont::DemiBold));
    to.setPen(t.ink2);
    auto words = step >= 1000 ? QStringLiteral("%1 km").arg(step / 1000) : QStringLiteral("%1 m").arg(step);
    to.drawText(QRectF(at.x() - 40, at.y() - 23, length + 80, 17), Qt::AlignCenter, words);
    to.setFont(font_of(9));
    to.setPen(t.ink3);
    to.drawText(QRectF(8, height - 18, width - 16, 17), Qt::AlignRight | Qt::AlignVCenter, text(coast_attribution()));
}

// The links by the colour of their track, and when the boat was heard over each: a lost one shows at once.
void paint_legend(QPainter& to, const chart_projection& projection, const chart_scene& scene) {
    if (!scene.seen) return;
    const auto& t = colours();
    struct part {
        QColor line, age_ink;
        QString name, age;
    };
    std::map<link_id, part> parts;
    bool history = false;
    for (const auto& p : *scene.seen->track) {
        parts[p.link].name = text(label(p.link));
        history = history || p.history;
    }
    for (const auto& link : scene.seen->links) {
        if (link.all_links || !link.link) continue;
        auto& one = parts[*link.link];
        one.name = text(label(*link.link));
        one.age = link.last_heard ? text(age_text(age_s(scene.now, *link.last_heard))) : QObject::tr("not heard");
        auto how = !link.last_heard
                       ? freshness::none
                       : judge(age_s(scene.now, *link.last_heard), scene.seen->boat.rhythm.position_s(*link.link));
        one.age_ink = t.of(how);
    }
    if (parts.empty()) return;
    for (auto& [link, one] : parts) one.line = t.of(link);
    to.setFont(font_of(11));
    QFontMetricsF metrics(to.font());
    auto later = QObject::tr("received later");
    double wide = 8;
    for (const auto& [link, one] : parts)
        wide += 24 + metrics.horizontalAdvance(one.name) + metrics.horizontalAdvance(one.age) + 5 + 14;
    if (history) wide += 24 + metrics.horizontalAdvance(later) + 12;
    QRectF box(projection.size.width() - wide - 10, 20, wide, 24);
    paint_panel(to, box);
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

void paint_pointer(QPainter& to, const chart_projection& projection, const chart_scene& scene,
                   const std::optional<QPointF>& pointer, const QString& hint) {
    QString words;
    auto at = scene.boat();
    if (pointer) {
        auto place = projection.to_place(*pointer);
        words = place_text(place);
        if (at)
            words += QStringLiteral("   ·   %1  %2 %3")
                         .arg(QObject::tr("from the boat"), distance_text(distance_m(*at, place)),
                              bearing_text(bearing_deg(*at, place)));
    } else if (at) {
        words = place_text(*at);
    } else {
        return;
    }
    if (!hint.isEmpty()) words += "   ·   " + hint;
    to.setFont(font_of(11));
    paint_note(to, QPointF(10, projection.size.height() - 45), 24, words, colours().ink2);
}

void paint_empty(QPainter& to, const chart_projection& projection, const chart_scene& scene) {
    const auto& t = colours();
    QString head = QObject::tr("No boat heard yet"), what, more;
    if (!scene.ended.isEmpty()) {
        head = QObject::tr("Nothing is received any more");
        what = QObject::tr("Start the console again; the red strip has the reason");
    } else if (scene.seen) {
        const auto& f = scene.seen->finding;
        what = QObject::tr("Looking for %1").arg(text(f.looking_for));
        if (!f.where.empty()) what += QObject::tr(" at %1").arg(text(f.where));
        if (f.uses_names && !f.reached)
            more = f.trouble.empty() ? QObject::tr("Asking the name server…")
                                     : QObject::tr("The name server is not reached; retrying");
        else if (scene.seen->links.empty())
            more = QObject::tr("No link to a boat is running yet; the console finds it as soon as it starts");
        else
            more = QObject::tr("%n link(s) found; waiting for the first packet", nullptr,
                               static_cast<int>(scene.seen->links.size()));
    }
    QRectF box(projection.size.width() / 2 - 200, projection.size.height() / 2 - 62, 400, 124);
    paint_panel(to, box);
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
