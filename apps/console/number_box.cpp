#include "number_box.hpp"

#include <QStyle>
#include <QWheelEvent>

#include <algorithm>
#include <cmath>

namespace atirma::console {
namespace {

/// Without an exponent: "4294967295".
QString digits(double value) {
    return std::abs(value) < 1e6 ? QString::number(value, 'g', 7) : QString::number(value, 'f', 0);
}

} // namespace

number_box::number_box(double low, double high, QWidget* parent) : QDoubleSpinBox(parent), low_(low), high_(high) {
    setRange(std::min(-1e9, low), std::max(1e9, high)); // Qt would change what is beyond the range
    setButtonSymbols(QAbstractSpinBox::NoButtons);
    connect(this, &QDoubleSpinBox::valueChanged, this, &number_box::show_state);
}

QString number_box::trouble() const {
    if (good()) return {};
    auto unit = suffix();
    return tr("%1 to %2%3, not %4").arg(digits(low_), digits(high_), unit, digits(value()));
}

void number_box::mark_changed(bool changed) {
    changed_ = changed;
    show_state();
}

void number_box::show_state() {
    QString state = !good() ? QStringLiteral("bad") : changed_ ? QStringLiteral("changed") : QString();
    if (property("state").toString() == state) return;
    setProperty("state", state);
    setAccessibleDescription(!good() ? trouble() : changed_ ? tr("changed, not sent") : QString());
    style()->unpolish(this);
    style()->polish(this);
}

void number_box::wheelEvent(QWheelEvent* event) { event->ignore(); }

} // namespace atirma::console
