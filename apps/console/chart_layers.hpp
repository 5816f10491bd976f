#pragma once
#include "chart_projection.hpp"
#include "chart_scene.hpp"

#include <QColor>
#include <QPen>
#include <QPolygonF>

#include <vector>

class QPainter;

// What lies on the chart.
namespace atirma::console {

/// The track, by the link that told it; older parts are paler.
void paint_track(QPainter& to, const chart_projection& projection, const chart_scene& scene);
/// The fence: its edges, and what is beyond it darker.
void paint_fence(QPainter& to, const chart_projection& projection, const chart_scene& scene);
/// The boat's list of waypoints, and the leg that it sails.
void paint_mission(QPainter& to, const chart_projection& projection, const chart_scene& scene);
/// A place that the operator is asked about.
void paint_target(QPainter& to, const chart_projection& projection, const chart_scene& scene, const waypoint& target);
/// The other boats of the fleet: their headings, names, and a mark for open alarms.
void paint_others(QPainter& to, const chart_projection& projection, const chart_scene& scene);
/// The boat by its heading, where it goes next, and how uncertain that is.
void paint_boat(QPainter& to, const chart_projection& projection, const chart_scene& scene);

/// The line through a list of waypoints, closed from three on. Returns where they are.
QPolygonF paint_route(QPainter& to, const chart_projection& projection, const std::vector<waypoint>& points,
                      const QPen& pen);
struct waypoint_look {
    QColor fill, edge, ink;
    double radius = 10;
};
void paint_waypoint(QPainter& to, QPointF at, int number, const waypoint_look& look);

} // namespace atirma::console
