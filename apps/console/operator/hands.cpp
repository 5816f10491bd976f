#include "hands.hpp"

#include <QAbstractButton>
#include <QApplication>
#include <QKeySequence>
#include <QScrollArea>
#include <QTest>
#include <QTimer>
#include <QWheelEvent>
#include <QWindow>

namespace atirma::console {
namespace {

/// The place of a point of a widget in its window.
QPoint in_window(const QWidget& of, QPoint at) { return of.mapTo(of.window(), at); }

void scroll_to(QWidget& what) {
    for (auto* above = what.parentWidget(); above; above = above->parentWidget())
        if (auto* area = qobject_cast<QScrollArea*>(above)) area->ensureWidgetVisible(&what);
}

} // namespace

void hands::click(QWidget& on, std::optional<QPoint> at, Qt::MouseButton with) {
    scroll_to(on);
    auto* window = on.window()->windowHandle();
    if (!window || !on.isVisible()) return;
    ++clicks_;
    QPointer<QWidget> there(&on); // a press may close what it is on
    auto place = in_window(on, at.value_or(on.rect().center()));
    QTest::mousePress(window, with, {}, place);
    if (there) QTest::mouseRelease(window, with, {}, place);
}

void hands::drag(QWidget& over, QPoint from, QPoint to) {
    auto* window = over.window()->windowHandle();
    ++clicks_;
    QTest::mousePress(window, Qt::LeftButton, {}, in_window(over, from));
    for (int step = 1; step <= 8; ++step) QTest::mouseMove(window, in_window(over, from + (to - from) * step / 8));
    QTest::mouseRelease(window, Qt::LeftButton, {}, in_window(over, to));
}

void hands::wheel(QWidget& over, int notches) {
    ++clicks_;
    auto at = over.rect().center();
    QWheelEvent turned(at, over.mapToGlobal(at), {}, {0, 120 * notches}, Qt::NoButton, {}, Qt::NoScrollPhase, false);
    QApplication::sendEvent(&over, &turned); // Qt 6.4 has no wheel in its test library
}

void hands::key(const QKeySequence& which) {
    auto* active = QApplication::activeWindow();
    if (auto* popup = QApplication::activePopupWidget()) active = popup;
    if (!active || !active->windowHandle()) return;
    ++keys_;
    QTest::keyClick(active->windowHandle(), which[0].key(), which[0].keyboardModifiers());
}

void hands::type(const QString& words) {
    key(QKeySequence(Qt::CTRL | Qt::Key_A)); // in the place of what is there
    auto* active = QApplication::activeWindow();
    if (!active || !active->windowHandle()) return;
    for (auto letter : words) {
        ++keys_;
        QTest::keyClick(active->windowHandle(), letter.toLatin1());
    }
}

void hands::hold(QAbstractButton& button, int ms) {
    scroll_to(button);
    auto* window = button.window()->windowHandle();
    if (!window || !button.isVisible()) return;
    ++clicks_;
    held_ = &button;
    auto place = in_window(button, button.rect().center());
    QTimer::singleShot(ms, &button, [this, window, place] {
        held_.clear();
        QTest::mouseRelease(window, Qt::LeftButton, {}, place);
    });
    QTest::mousePress(window, Qt::LeftButton, {}, place);
}

} // namespace atirma::console
