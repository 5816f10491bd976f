#pragma once
#include <components/boat/packet_header.hpp>

#include <QByteArray>
#include <QString>

#include <string>
#include <vector>

namespace atirma::console {

/// A route that was read, or why it was not.
struct route_file {
    std::vector<waypoint> points;
    QString name;
    QString trouble; ///< empty: it was read
};

/// The first route of a GPX file (1.0 or 1.1); without a route, its waypoints. Refused: what is not GPX, a point that
/// is none, more than `mission_draft::most` points, or nothing in it. A track is not a route.
route_file route_from_gpx(const QByteArray& content);
/// GPX 1.1 with one route. `name` may have any characters.
std::string route_to_gpx(const QString& name, const std::vector<waypoint>& points);

} // namespace atirma::console
