#pragma once
#include "chart_projection.hpp"
#include "chart_scene.hpp"

#include <QColor>
#include <QRectF>
#include <QString>

#include <optional>

class QPainter;

// What lies over the chart.
namespace atirma::console {

void paint_scale(QPainter& to, const chart_projection& projection);
/// The links by the colour of their track, and when the boat was heard over each: a lost one shows at once.
void paint_legend(QPainter& to, const chart_projection& projection, const chart_scene& scene);
/// The place under the pointer, or that of the boat; `hint` behind it.
void paint_pointer(QPainter& to, const chart_projection& projection, const chart_scene& scene,
                   const std::optional<QPointF>& pointer, const QString& hint);
/// What is looked for, where no boat was heard yet.
void paint_empty(QPainter& to, const chart_projection& projection, const chart_scene& scene);

void paint_panel(QPainter& to, const QRectF& box);
/// A line of words on a panel of their width, in the painter's font.
void paint_note(QPainter& to, QPointF at, double height, const QString& words, const QColor& ink);

} // namespace atirma::console
