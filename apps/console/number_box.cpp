#include "number_box.hpp"

#include <QStyle>
#include <QWheelEvent>

namespace atirma::console {

number_box::number_box(double low, double high, QWidget* parent) : QDoubleSpinBox(parent), low_(low), high_(high) {
    setRange(-1e9, 1e9); // Qt would change what is beyond the range
    setButtonSymbols(QAbstractSpinBox::NoButtons);
    connect(this, &QDoubleSpinBox::valueChanged, this, &number_box::show_state);
}

QString number_box::trouble() const {
    if (good()) return {};
    auto unit = suffix();
    return tr("%1 to %2%3, not %4")
        .arg(QString::number(low_, 'g', 7), QString::number(high_, 'g', 7), unit, QString::number(value(), 'g', 7));
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
