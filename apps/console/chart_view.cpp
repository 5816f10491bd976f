#include "chart_view.hpp"

#include "boat_words.hpp"
#include "chart_furniture.hpp"
#include "chart_layers.hpp"
#include "theme.hpp"
#include "units.hpp"

#include <components/gui_client/freshness.hpp>

#include <QContextMenuEvent>
#include <QHelpEvent>
#include <QKeyEvent>
#include <QMenu>
#include <QMouseEvent>
#include <QPainter>
#include <QPainterPath>
#include <QToolTip>

#include <cmath>
#include <utility>

namespace atirma::console {

chart_view::chart_view(mission_draft& draft, QWidget* parent)
    : QWidget(parent), draft_(draft), editor_(draft, viewport_.projection) {
    setMinimumSize(280, 200);
    setMouseTracking(true);
    setFocusPolicy(Qt::StrongFocus);
    setObjectName("chart");
    setAccessibleName(tr("Chart"));
    connect(&draft_, &mission_draft::changed, this, [this] { update(); });
}

void chart_view::show_snapshot(std::shared_ptr<const snapshot> seen, utc_time now) {
    scene_.seen = std::move(seen);
    scene_.now = now;
    auto boat = scene_.boat();
    if (boat) viewport_.keep_in_sight(*boat);
    if (boat && !placed() && isVisible() && !scene_.seen->mission.points.empty()) {
        viewport_.set_placed();
        fit();
        zoom(0.6); // some of the coast beside them
    }
    describe();
}

void chart_view::show_ended(const QString& why) {
    if (scene_.ended == why) return;
    scene_.ended = why;
    update();
}

void chart_view::show_others(std::vector<other_boat> others) {
    scene_.others = std::move(others);
    describe();
}

void chart_view::describe() {
    auto boat = scene_.boat();
    auto words =
        boat ? tr("The boat at %1, %2")
                   .arg(place_text(*boat), text(age_text(age_s(scene_.now, scene_.seen->boat.position->measured_at))))
             : tr("No boat heard yet");
    for (const auto& one : scene_.others) words += tr("; %1 at %2").arg(one.name, place_text(one.at));
    setAccessibleDescription(words);
    update();
}

// --- what is shown --------------------------------------------------------------------------------------------------

void chart_view::set_follow(bool on) {
    if (following() == on) return;
    viewport_.set_follow(on);
    if (auto boat = scene_.boat(); on && boat) projection().centre = *boat;
    update();
    Q_EMIT follow_changed(on);
}

void chart_view::set_edit(bool on) {
    if (on) ruler_.set(false);
    editor_.set(on);
    setCursor(on ? Qt::CrossCursor : Qt::ArrowCursor);
    update();
}

void chart_view::set_measure(bool on) {
    ruler_.set(on);
    setCursor(on ? Qt::CrossCursor : Qt::ArrowCursor);
    update();
}

void chart_view::set_tail(double seconds) {
    scene_.tail_s = seconds;
    update();
}

std::vector<waypoint> chart_view::everything() const {
    std::vector<waypoint> all = draft_.points();
    if (scene_.seen) all.insert(all.end(), scene_.seen->mission.points.begin(), scene_.seen->mission.points.end());
    if (auto boat = scene_.boat()) all.push_back(*boat);
    return all;
}

void chart_view::fit() {
    viewport_.fit(everything());
    update();
}

void chart_view::fit_fleet() {
    std::vector<waypoint> all;
    for (const auto& one : scene_.others) all.push_back(one.at);
    if (auto boat = scene_.boat()) all.push_back(*boat);
    set_follow(false); // else the next report would move it back
    viewport_.fit(all);
    update();
}

const other_boat* chart_view::other_at(QPointF at) const {
    constexpr double reach = 14;
    const other_boat* nearest = nullptr;
    double least = reach;
    for (const auto& one : scene_.others) {
        auto from = viewport_.projection.to_pixels(one.at) - at;
        if (auto far = std::hypot(from.x(), from.y()); far <= least) {
            least = far;
            nearest = &one;
        }
    }
    return nearest;
}

void chart_view::zoom(double factor) { zoom_at(factor, QPointF(width() / 2.0, height() / 2.0)); }

void chart_view::zoom_at(double factor, QPointF at) {
    viewport_.zoom(factor, at, scene_.boat());
    update();
}

void chart_view::pan(QPointF by) {
    set_follow(false);
    projection().pan(by);
    update();
}

void chart_view::place(const waypoint& centre, double metres_per_pixel) {
    viewport_.place(centre, metres_per_pixel);
    update();
}

void chart_view::insert_at(const waypoint& place) {
    if (!editor_.insert(place)) Q_EMIT edit_refused(tr("A boat takes %1 waypoints at most.").arg(mission_draft::most));
}

void chart_view::resizeEvent(QResizeEvent*) { projection().size = QSizeF(size()); }

void chart_view::changeEvent(QEvent* event) {
    if (event->type() == QEvent::PaletteChange || event->type() == QEvent::StyleChange) {
        base_.invalidate();
        update();
    }
    QWidget::changeEvent(event);
}

void chart_view::paintEvent(QPaintEvent*) {
    const auto& shown = viewport_.projection;
    QPainter to(this);
    to.setRenderHint(QPainter::Antialiasing);
    to.drawPixmap(0, 0, base_.picture(shown, devicePixelRatioF()));
    paint_fence(to, shown, scene_);
    paint_track(to, shown, scene_);
    paint_mission(to, shown, scene_);
    editor_.paint(to);
    if (asked_) paint_target(to, shown, scene_, *asked_);
    paint_others(to, shown, scene_);
    paint_boat(to, shown, scene_);
    ruler_.paint(to, shown, pointer_);
    paint_scale(to, shown);
    paint_legend(to, shown, scene_);
    bool hints = editing() && !pressed_at_;
    paint_pointer(to, shown, scene_, pointer_, hints ? tr("click adds, drag moves, Del removes") : QString());
    if (!scene_.boat()) paint_empty(to, shown, scene_);
    QPainterPath corners;
    corners.addRect(rect());
    corners.addRoundedRect(QRectF(rect()).adjusted(0.5, 0.5, -0.5, -0.5), 9, 9);
    to.fillPath(corners, colours().page);
    to.setPen(QPen(hasFocus() ? colours().accent : colours().line, 1.2));
    to.setBrush(Qt::NoBrush);
    to.drawRoundedRect(QRectF(rect()).adjusted(0.6, 0.6, -0.6, -0.6), 9, 9);
}

// --- what hands do --------------------------------------------------------------------------------------------------

void chart_view::mousePressEvent(QMouseEvent* event) {
    setFocus();
    pressed_at_ = last_mouse_ = event->position();
    dragged_ = false;
    editor_.drop();
    if (!editing()) return;
    if (event->button() != Qt::RightButton) return editor_.grab(event->position());
    if (editor_.remove(event->position())) pressed_at_.reset();
}

void chart_view::mouseMoveEvent(QMouseEvent* event) {
    pointer_ = event->position();
    update();
    if (!pressed_at_ || !(event->buttons() & Qt::LeftButton)) return;
    bool far = (event->position() - *pressed_at_).manhattanLength() > 4;
    if (!far && !dragged_) return;
    dragged_ = true;
    auto from = std::exchange(last_mouse_, event->position());
    if (editor_.holds()) editor_.drag(event->position());
    else pan(event->position() - *from);
}

void chart_view::mouseReleaseEvent(QMouseEvent* event) {
    bool click = pressed_at_ && !dragged_ && event->button() == Qt::LeftButton;
    pressed_at_.reset();
    bool held = editor_.holds();
    editor_.drop();
    if (held || !click) return;
    auto place = projection().to_place(event->position());
    if (measuring()) ruler_.add(place);
    else if (editing()) insert_at(place);
    else editor_.select(event->position());
    update();
}

void chart_view::mouseDoubleClickEvent(QMouseEvent* event) {
    if (editing() || measuring()) return mousePressEvent(event);
    if (const auto* other = other_at(event->position())) return Q_EMIT boat_wanted(other->number);
    set_follow(false);
    zoom_at(2, event->position());
}

void chart_view::wheelEvent(QWheelEvent* event) {
    zoom_at(std::pow(1.25, event->angleDelta().y() / 120.0), event->position());
    event->accept();
}

void chart_view::keyPressEvent(QKeyEvent* event) {
    switch (event->key()) {
        case Qt::Key_Left: return pan({60, 0});
        case Qt::Key_Right: return pan({-60, 0});
        case Qt::Key_Up: return pan({0, 60});
        case Qt::Key_Down: return pan({0, -60});
        case Qt::Key_Delete:
        case Qt::Key_Backspace:
            if (editor_.remove_selected()) return;
            if (ruler_.take_back()) return update();
            break;
        case Qt::Key_Escape:
            if (measuring()) return set_measure(false);
            draft_.select(-1);
            break;
        default: break;
    }
    QWidget::keyPressEvent(event);
}

bool chart_view::event(QEvent* event) {
    if (event->type() != QEvent::ToolTip) return QWidget::event(event);
    auto* help = static_cast<QHelpEvent*>(event);
    const auto* other = other_at(QPointF(help->pos()));
    if (!other) {
        QToolTip::hideText();
        return true;
    }
    auto state = state_of(*other->seen, scene_.now);
    QToolTip::showText(
        help->globalPos(),
        tr("%1: %2, %3; a double click shows it").arg(other->name, state.words, mode_words(*other->seen, scene_.now)),
        this);
    return true;
}

void chart_view::leaveEvent(QEvent*) {
    pointer_.reset();
    update();
}

void chart_view::contextMenuEvent(QContextMenuEvent* event) {
    if (editing()) return; // there a right click removes
    bool by_key = event->reason() == QContextMenuEvent::Keyboard;
    QPointF at = by_key ? QPointF(width() / 2.0, height() / 2.0) : QPointF(event->pos());
    auto there = projection().to_place(at);
    pressed_at_.reset();
    asked_ = there; // it is marked until all is answered
    update();
    QMenu menu(this);
    menu.setObjectName("chart_menu");
    auto* head = menu.addAction(place_text(there));
    head->setEnabled(false);
    menu.addSeparator();
    if (const auto* other = other_at(at))
        connect(menu.addAction(tr("Show %1").arg(other->name)), &QAction::triggered, this,
                [this, number = other->number] { Q_EMIT boat_wanted(number); });
    connect(menu.addAction(tr("Sail here…")), &QAction::triggered, this, [this, there] { Q_EMIT sail_wanted(there); });
    connect(menu.addAction(tr("Add to the list edited here")), &QAction::triggered, this,
            [this, there] { insert_at(there); });
    connect(menu.addAction(tr("Measure from here")), &QAction::triggered, this, [this, there] {
        set_measure(true);
        ruler_.add(there);
    });
    connect(menu.addAction(tr("Centre here")), &QAction::triggered, this, [this, there] {
        set_follow(false);
        projection().centre = there;
        update();
    });
    menu.exec(by_key ? mapToGlobal(at.toPoint()) : event->globalPos());
    asked_.reset();
    update();
}

} // namespace atirma::console
