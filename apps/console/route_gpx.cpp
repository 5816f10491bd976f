#include "route_gpx.hpp"

#include "mission_draft.hpp"

#include <QObject>
#include <QXmlStreamReader>
#include <QXmlStreamWriter>

#include <cmath>
#include <optional>

namespace atirma::console {
namespace {

std::optional<waypoint> point_of(const QXmlStreamReader& at) {
    bool north = false, east = false;
    waypoint made{at.attributes().value("lat").toDouble(&north), at.attributes().value("lon").toDouble(&east)};
    if (!north || !east || !(std::abs(made.latitude_deg) <= 90) || !(std::abs(made.longitude_deg) <= 180))
        return std::nullopt;
    return made;
}

} // namespace

route_file route_from_gpx(const QByteArray& content) {
    route_file made;
    auto fail = [&](const QString& why) {
        made.points.clear();
        made.trouble = why;
        return made;
    };
    QXmlStreamReader from(content);
    std::vector<waypoint> loose; // outside of routes
    int routes = 0;
    bool in_route = false, is_gpx = false;
    QString last; // the element around
    while (!from.atEnd()) {
        auto token = from.readNext();
        auto name = from.name();
        if (token == QXmlStreamReader::EndElement && name == u"rte") in_route = false;
        if (token != QXmlStreamReader::StartElement) continue;
        if (!is_gpx && name != u"gpx") return fail(QObject::tr("it is not a GPX file"));
        is_gpx = true;
        bool first_route = in_route && routes == 1;
        if (name == u"rte") {
            in_route = true;
            ++routes;
            last = "rte";
        } else if (name == u"rtept" || name == u"wpt") {
            last = name.toString();
            if (name == u"rtept" && !first_route) continue;
            auto point = point_of(from);
            if (!point) return fail(QObject::tr("line %1: a point without a valid lat and lon").arg(from.lineNumber()));
            auto& to = name == u"rtept" ? made.points : loose;
            if (to.size() >= mission_draft::most)
                return fail(QObject::tr("it has more than %1 points").arg(mission_draft::most));
            to.push_back(*point);
        } else if (name == u"name" && last == "rte" && first_route) {
            made.name = from.readElementText(QXmlStreamReader::SkipChildElements).trimmed();
        }
    }
    if (from.hasError()) return fail(QObject::tr("line %1: %2").arg(from.lineNumber()).arg(from.errorString()));
    if (routes == 0) made.points = std::move(loose);
    if (made.points.empty()) return fail(QObject::tr("it has no route and no waypoints"));
    return made;
}

std::string route_to_gpx(const QString& name, const std::vector<waypoint>& points) {
    QByteArray made;
    QXmlStreamWriter to(&made);
    to.setAutoFormatting(true);
    to.writeStartDocument();
    to.writeStartElement("gpx");
    to.writeDefaultNamespace("http://www.topografix.com/GPX/1/1");
    to.writeAttribute("version", "1.1");
    to.writeAttribute("creator", "atirma_console");
    to.writeStartElement("rte");
    to.writeTextElement("name", name);
    int number = 0;
    for (const auto& point : points) {
        to.writeStartElement("rtept");
        to.writeAttribute("lat", QString::number(point.latitude_deg, 'f', 7));
        to.writeAttribute("lon", QString::number(point.longitude_deg, 'f', 7));
        to.writeTextElement("name", QString::number(++number));
        to.writeEndElement();
    }
    to.writeEndDocument();
    return made.toStdString();
}

} // namespace atirma::console
