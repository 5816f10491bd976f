#pragma once
#include "theme.hpp"

#include <QComboBox>
#include <QPainter>
#include <QWheelEvent>

namespace atirma::console {

/// A combo box with a small arrow, in the colours of the theme. The wheel scrolls the list around it and never changes
/// a choice.
class choice_box : public QComboBox {
public:
    using QComboBox::QComboBox;

protected:
    void paintEvent(QPaintEvent* event) override {
        QComboBox::paintEvent(event);
        QPainter to(this);
        to.setRenderHint(QPainter::Antialiasing);
        to.setPen(QPen(isEnabled() ? colours().ink2 : colours().ink3, 1.6, Qt::SolidLine, Qt::RoundCap, Qt::RoundJoin));
        QPointF at(width() - 14, height() / 2.0);
        to.drawPolyline(QPolygonF({at + QPointF(-4, -2), at + QPointF(0, 2.5), at + QPointF(4, -2)}));
    }
    void wheelEvent(QWheelEvent* event) override { event->ignore(); }
};

} // namespace atirma::console
