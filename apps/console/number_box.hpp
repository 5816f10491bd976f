#pragma once
#include <QDoubleSpinBox>

namespace atirma::console {

/// A number that is entered. One out of its range stays as it was typed, is marked, and `trouble()` says what is wrong:
/// it is never changed into another. A changed one is marked, too. The wheel scrolls the list around it.
class number_box : public QDoubleSpinBox {
    Q_OBJECT
public:
    number_box(double low, double high, QWidget* parent = nullptr);

    bool good() const { return value() >= low_ && value() <= high_; }
    /// "60 to 86400 s, not 12"; empty: it is in its range.
    QString trouble() const;
    /// Whether it differs from what is in use.
    void mark_changed(bool changed);

protected:
    void wheelEvent(QWheelEvent* event) override;

private:
    void show_state();

    double low_, high_;
    bool changed_ = false;
};

} // namespace atirma::console
