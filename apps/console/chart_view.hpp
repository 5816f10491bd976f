#pragma once
#include "chart_base.hpp"
#include "chart_ruler.hpp"
#include "chart_scene.hpp"
#include "chart_viewport.hpp"
#include "waypoint_editor.hpp"

#include <QWidget>

#include <memory>
#include <optional>
#include <vector>

namespace atirma::console {

/// The chart: coast, graticule, the boat by its heading, its track by the link that told it, the boat's waypoints and
/// those that are edited. Pan by dragging, zoom by wheel or + and -; in edit mode a click adds a waypoint and
/// dragging moves one. This widget passes events on to its parts, and paints them over each other.
class chart_view : public QWidget {
    Q_OBJECT
public:
    explicit chart_view(mission_draft& draft, QWidget* parent = nullptr);

    void show_snapshot(std::shared_ptr<const snapshot> seen, utc_time now);
    /// The other boats of the fleet: those whose place is known.
    void show_others(std::vector<other_boat> others);
    /// Why nothing newer comes; empty: the boat is followed.
    void show_ended(const QString& why);
    chart_projection& projection() noexcept { return viewport_.projection; }
    bool following() const noexcept { return viewport_.following(); }
    bool editing() const noexcept { return editor_.on(); }
    bool measuring() const noexcept { return ruler_.on(); }

    void set_follow(bool on);
    void set_edit(bool on);
    void set_measure(bool on);
    /// Only the track of so many seconds is drawn; 0: all.
    void set_tail(double seconds);
    /// The boat and all waypoints.
    void fit();
    /// All boats of the fleet.
    void fit_fleet();
    void zoom(double factor);
    /// As it was left: no more fitting when the boat is found.
    void place(const waypoint& centre, double metres_per_pixel);
    double tail() const noexcept { return scene_.tail_s; }
    bool placed() const noexcept { return viewport_.placed(); } ///< on the boat, or where it was left

Q_SIGNALS:
    void follow_changed(bool on);
    void edit_refused(const QString& why);
    /// The operator wants the boat to go there.
    void sail_wanted(const waypoint& place);
    /// The operator wants to see that boat instead.
    void boat_wanted(std::size_t boat);

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
    bool event(QEvent*) override;

private:
    void describe(); ///< for a screen reader
    std::vector<waypoint> everything() const;
    /// The other boat under that pixel; null: none.
    const other_boat* other_at(QPointF at) const;
    void zoom_at(double factor, QPointF at);
    void pan(QPointF by);
    void insert_at(const waypoint& place);

    mission_draft& draft_;
    chart_scene scene_;
    chart_viewport viewport_;
    chart_base base_;
    chart_ruler ruler_;
    waypoint_editor editor_;
    std::optional<QPointF> pressed_at_, last_mouse_, pointer_;
    bool dragged_ = false;          ///< since the button was pressed
    std::optional<waypoint> asked_; ///< the place of the menu that is open
};

} // namespace atirma::console
