#pragma once
#include <QElapsedTimer>
#include <QPushButton>
#include <QTimer>

namespace atirma::console {

/// A button for what is dangerous: it must be held for a second, by the mouse or the space bar, and then emits
/// `clicked`. A bar fills meanwhile. Enter does nothing; a short press shows what to do.
class hold_button : public QPushButton {
    Q_OBJECT
public:
    static constexpr int hold_ms = 1000;
    explicit hold_button(const QString& words, QWidget* parent = nullptr);

Q_SIGNALS:
    /// It was let go too early.
    void too_short();

protected:
    void paintEvent(QPaintEvent* event) override;
    void mousePressEvent(QMouseEvent* event) override;
    void mouseReleaseEvent(QMouseEvent* event) override;
    void mouseMoveEvent(QMouseEvent* event) override;
    void keyPressEvent(QKeyEvent* event) override;
    void keyReleaseEvent(QKeyEvent* event) override;
    void focusOutEvent(QFocusEvent* event) override;

private:
    void begin();
    void end();
    void step();

    QTimer timer_;
    QElapsedTimer held_;
    bool holds_ = false;
};

} // namespace atirma::console
