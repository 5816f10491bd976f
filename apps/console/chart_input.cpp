#include "chart_view.hpp"

#include <QContextMenuEvent>
#include <QKeyEvent>
#include <QMenu>
#include <QMouseEvent>

// What hands do on the chart: mouse, keys, menu.
namespace atirma::console {

std::optional<std::size_t> chart_view::waypoint_at(QPointF pixel) const {
    std::optional<std::size_t> nearest;
    double best = 14;
    for (std::size_t i = 0; i < draft_.points().size(); ++i) {
        auto away = projection_.to_pixels(draft_.points()[i]) - pixel;
        double length = std::hypot(away.x(), away.y());
        if (length > best) continue;
        best = length;
        nearest = i;
    }
    return nearest;
}

void chart_view::mousePressEvent(QMouseEvent* event) {
    setFocus();
    pressed_at_ = last_mouse_ = event->position();
    panned_ = false;
    dragged_.reset();
    if (!edit_) return;
    auto hit = waypoint_at(event->position());
    if (!hit) return;
    if (event->button() == Qt::RightButton) {
        pressed_at_.reset();
        draft_.remove(*hit);
        return;
    }
    draft_.select(static_cast<int>(*hit));
    dragged_ = hit;
}

void chart_view::mouseMoveEvent(QMouseEvent* event) {
    pointer_ = event->position();
    update();
    if (!pressed_at_ || !(event->buttons() & Qt::LeftButton)) return;
    auto by = event->position() - *last_mouse_;
    bool far = (event->position() - *pressed_at_).manhattanLength() > 4;
    if (!far && !panned_) return;
    if (dragged_) {
        if (!panned_) draft_.begin_drag();
        draft_.drag(*dragged_, projection_.to_place(event->position()));
    } else {
        if (follow_) set_follow(false);
        projection_.pan(by);
        moved();
    }
    panned_ = true;
    last_mouse_ = event->position();
}

void chart_view::mouseReleaseEvent(QMouseEvent* event) {
    bool click = pressed_at_ && !panned_ && event->button() == Qt::LeftButton;
    pressed_at_.reset();
    if (std::exchange(dragged_, std::nullopt)) return;
    if (!click) return;
    auto place = projection_.to_place(event->position());
    if (measure_) {
        measured_.push_back(place);
        update();
    } else if (edit_) {
        insert_at(place);
    } else if (auto hit = waypoint_at(event->position())) {
        draft_.select(static_cast<int>(*hit));
    }
}

void chart_view::mouseDoubleClickEvent(QMouseEvent* event) {
    if (edit_ || measure_) return mousePressEvent(event);
    if (follow_) set_follow(false);
    projection_.zoom(2, event->position());
    moved();
}

void chart_view::wheelEvent(QWheelEvent* event) {
    double steps = event->angleDelta().y() / 120.0;
    auto at = follow_ && boat_place() ? projection_.to_pixels(*boat_place()) : event->position();
    projection_.zoom(std::pow(1.25, steps), at);
    moved();
    event->accept();
}

void chart_view::keyPressEvent(QKeyEvent* event) {
    auto pan = [this](double x, double y) {
        if (follow_) set_follow(false);
        projection_.pan({x, y});
        moved();
    };
    switch (event->key()) {
        case Qt::Key_Left: return pan(60, 0);
        case Qt::Key_Right: return pan(-60, 0);
        case Qt::Key_Up: return pan(0, 60);
        case Qt::Key_Down: return pan(0, -60);
        case Qt::Key_Delete:
        case Qt::Key_Backspace:
            if (edit_ && draft_.selected() >= 0) return draft_.remove(static_cast<std::size_t>(draft_.selected()));
            if (measure_ && !measured_.empty()) {
                measured_.pop_back();
                return update();
            }
            break;
        case Qt::Key_Escape:
            if (measure_) return set_measure(false);
            draft_.select(-1);
            break;
        default: break;
    }
    QWidget::keyPressEvent(event);
}

void chart_view::leaveEvent(QEvent*) {
    pointer_.reset();
    update();
}

void chart_view::insert_at(const waypoint& place) {
    auto before = draft_.selected() >= 0 ? static_cast<std::size_t>(draft_.selected()) + 1 : draft_.points().size();
    if (!draft_.insert(before, place))
        Q_EMIT edit_refused(tr("A boat takes %1 waypoints at most.").arg(mission_draft::most));
}

void chart_view::contextMenuEvent(QContextMenuEvent* event) {
    if (edit_) return; // there a right click removes
    bool by_key = event->reason() == QContextMenuEvent::Keyboard;
    QPointF at = by_key ? QPointF(width() / 2.0, height() / 2.0) : QPointF(event->pos());
    auto there = projection_.to_place(at);
    pressed_at_.reset();
    asked_ = there; // it is marked until all is answered
    update();
    QMenu menu(this);
    menu.setObjectName("chart_menu");
    auto* head = menu.addAction(place_text(there));
    head->setEnabled(false);
    menu.addSeparator();
    connect(menu.addAction(tr("Sail here…")), &QAction::triggered, this, [this, there] { Q_EMIT sail_wanted(there); });
    connect(menu.addAction(tr("Add to the list edited here")), &QAction::triggered, this,
            [this, there] { insert_at(there); });
    connect(menu.addAction(tr("Measure from here")), &QAction::triggered, this, [this, there] {
        set_measure(true);
        measured_.push_back(there);
    });
    connect(menu.addAction(tr("Centre here")), &QAction::triggered, this, [this, there] {
        set_follow(false);
        projection_.centre = there;
        moved();
    });
    menu.exec(by_key ? mapToGlobal(at.toPoint()) : event->globalPos());
    asked_.reset();
    update();
}

} // namespace atirma::console
