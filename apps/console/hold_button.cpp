#include "hold_button.hpp"

#include "theme.hpp"

#include <QKeyEvent>
#include <QMouseEvent>
#include <QPainter>
#include <QPainterPath>
#include <QToolTip>

#include <algorithm>

namespace atirma::console {

hold_button::hold_button(const QString& words, QWidget* parent) : QPushButton(words, parent) {
    setAutoDefault(false);
    setToolTip(tr("Hold for a second (mouse or space bar)"));
    setAccessibleDescription(toolTip());
    timer_.setInterval(25);
    connect(&timer_, &QTimer::timeout, this, &hold_button::step);
}

void hold_button::begin() {
    if (holds_ || !isEnabled()) return;
    holds_ = true;
    held_.start();
    timer_.start();
    setDown(true);
    update();
}

void hold_button::end() {
    if (!holds_) return;
    holds_ = false;
    timer_.stop();
    setDown(false);
    update();
    QToolTip::showText(mapToGlobal(QPoint(width() / 2, 0)), toolTip(), this);
    Q_EMIT too_short();
}

void hold_button::step() {
    if (held_.elapsed() < hold_ms) return update();
    holds_ = false;
    timer_.stop();
    setDown(false);
    update();
    Q_EMIT clicked(false);
}

void hold_button::paintEvent(QPaintEvent* event) {
    QPushButton::paintEvent(event);
    if (!holds_) return;
    QPainter to(this);
    to.setRenderHint(QPainter::Antialiasing);
    double part = std::clamp(static_cast<double>(held_.elapsed()) / hold_ms, 0.0, 1.0);
    to.setPen(Qt::NoPen);
    to.setBrush(colours().bad);
    to.drawRoundedRect(QRectF(4, height() - 6, (width() - 8) * part, 4), 2, 2);
}

void hold_button::mousePressEvent(QMouseEvent* event) {
    if (event->button() == Qt::LeftButton) begin();
    event->accept();
}
void hold_button::mouseReleaseEvent(QMouseEvent* event) {
    end();
    event->accept();
}
void hold_button::mouseMoveEvent(QMouseEvent* event) {
    if (!rect().contains(event->position().toPoint())) end();
    event->accept();
}
void hold_button::keyPressEvent(QKeyEvent* event) {
    if (event->key() == Qt::Key_Return || event->key() == Qt::Key_Enter) return event->accept(); // does no harm
    if (event->key() != Qt::Key_Space) return QPushButton::keyPressEvent(event);
    if (!event->isAutoRepeat()) begin();
    event->accept();
}
void hold_button::keyReleaseEvent(QKeyEvent* event) {
    if (event->key() != Qt::Key_Space) return QPushButton::keyReleaseEvent(event);
    if (!event->isAutoRepeat()) end();
    event->accept();
}
void hold_button::focusOutEvent(QFocusEvent* event) {
    end();
    QPushButton::focusOutEvent(event);
}

} // namespace atirma::console
