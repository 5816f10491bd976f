#pragma once
#include "chart_projection.hpp"
#include "mission_draft.hpp"
#include "units.hpp"

#include <components/gui_client/view.hpp>

#include <QPixmap>
#include <QWidget>

#include <functional>
#include <memory>
#include <optional>

namespace atirma::console {

/// The chart: coast, graticule, the boat by its heading, its track by the link that told it, the boat's waypoints and
/// those that are edited. Pan by dragging, zoom by wheel or + and -; in edit mode a click adds a waypoint and
/// dragging moves one.
class chart_view : public QWidget {
    Q_OBJECT
public:
    explicit chart_view(mission_draft& draft, QWidget* parent = nullptr);

    void show_snapshot(std::shared_ptr<const snapshot> seen, utc_time now);
    chart_projection& projection() noexcept { return projection_; }
    bool following() const noexcept { return follow_; }
    bool editing() const noexcept { return edit_; }
    bool measuring() const noexcept { return measure_; }

    void set_follow(bool on);
    void set_edit(bool on);
    void set_measure(bool on);
    /// Only the track of so many seconds is drawn; 0: all.
    void set_tail(double seconds);
    /// All of track and waypoints.
    void fit();
    void zoom(double factor);
    /// As it was left: no more fitting when the boat is found.
    void place(const waypoint& centre, double metres_per_pixel);
    double tail() const noexcept { return tail_s_; }
    bool placed() const noexcept { return placed_; } ///< on the boat, or where it was left

Q_SIGNALS:
    void follow_changed(bool on);
    void edit_refused(const QString& why);
    /// The operator wants the boat to go there.
    void sail_wanted(const waypoint& place);

protected:
    void paintEvent(QPaintEvent*) override;
    void resizeEvent(QResizeEvent*) override;
    void mousePressEvent(QMouseEvent*) override;
    void mouseMoveEvent(QMouseEvent*) override;
    void mouseReleaseEvent(QMouseEvent*) override;
    void mouseDoubleClickEvent(QMouseEvent*) override;
    void wheelEvent(QWheelEvent*) override;
    void keyPressEvent(QKeyEvent*) override;
    void leaveEvent(QEvent*) override;
    void changeEvent(QEvent*) override;
    void contextMenuEvent(QContextMenuEvent*) override;

private:
    // chart_input.cpp
    std::optional<std::size_t> waypoint_at(QPointF pixel) const;
    void insert_at(const waypoint& place);
    // chart_view.cpp
    std::optional<waypoint> boat_place() const;
    void moved();
    // chart_layers.cpp
    void paint_base();
    /// The lines, or their numbers, which lie over the land.
    void paint_graticule(QPainter& to, bool numbers) const;
    void paint_track(QPainter& to) const;
    void paint_mission(QPainter& to) const;
    void paint_draft(QPainter& to) const;
    /// The place that the operator is asked about.
    void paint_asked(QPainter& to) const;
    void paint_boat(QPainter& to) const;
    // chart_furniture.cpp
    void paint_scale(QPainter& to) const;
    void paint_legend(QPainter& to) const;
    void paint_pointer(QPainter& to) const;
    void paint_measure(QPainter& to) const;
    void paint_empty(QPainter& to) const;

    mission_draft& draft_;
    std::shared_ptr<const snapshot> seen_;
    utc_time now_{};
    chart_projection projection_;
    QPixmap base_;
    bool base_valid_ = false;
    bool follow_ = true, edit_ = false, measure_ = false, placed_ = false;
    double tail_s_ = 0;
    std::optional<QPointF> pressed_at_, last_mouse_, pointer_;
    std::optional<std::size_t> dragged_;
    bool panned_ = false;
    std::vector<waypoint> measured_;
    std::optional<waypoint> asked_;
};

} // namespace atirma::console
