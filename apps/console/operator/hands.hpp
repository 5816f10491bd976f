#pragma once
#include <QPoint>
#include <QPointer>
#include <QString>

#include <cstdint>
#include <optional>

class QAbstractButton;
class QKeySequence;
class QWidget;

namespace atirma::console {

/// Mouse and keyboard of a person: the events take the way of those of a real device, so they reach whatever is shown
/// at that place, and a window that is not in front gets none.
class hands {
public:
    /// In its middle, unless there is a place. What is scrolled out of sight is scrolled to.
    void click(QWidget& on, std::optional<QPoint> at = std::nullopt, Qt::MouseButton with = Qt::LeftButton);
    void drag(QWidget& over, QPoint from, QPoint to);
    void wheel(QWidget& over, int notches);
    void key(const QKeySequence& which);
    void type(const QString& words);
    /// Keeps a button pressed for `ms`; returns at once.
    void hold(QAbstractButton& button, int ms);
    bool holding() const noexcept { return !held_.isNull(); }

    std::uint64_t clicks() const noexcept { return clicks_; }
    std::uint64_t keys() const noexcept { return keys_; }

private:
    std::uint64_t clicks_ = 0, keys_ = 0;
    QPointer<QAbstractButton> held_;
};

} // namespace atirma::console
