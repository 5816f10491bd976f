#pragma once
#include <components/boat/telemetry.hpp>

#include <QObject>

#include <cstddef>
#include <vector>

namespace atirma::console {

/// The list of waypoints that is edited here, shared by chart and table. Until the first edit it is the boat's list.
class mission_draft : public QObject {
    Q_OBJECT
public:
    static constexpr std::size_t most = 100; ///< of a boat's list

    const std::vector<waypoint>& points() const noexcept { return points_; }
    bool edited() const noexcept { return edited_; }
    int selected() const noexcept { return selected_; }
    bool can_undo() const noexcept { return !before_.empty(); }

    /// Returns false if the list is full.
    bool insert(std::size_t before, waypoint at);
    void move(std::size_t index, waypoint to);
    /// Moves without a new undo step, while the mouse drags.
    void drag(std::size_t index, waypoint to);
    void begin_drag() { remember(); }
    void remove(std::size_t index);
    void swap(std::size_t a, std::size_t b);
    void clear();
    void undo();
    void select(int index);
    /// The boat's list: replaces this one unless it is edited.
    void follow(const std::vector<waypoint>& on_boat);
    /// The edited list from before a restart of the console.
    void restore(std::vector<waypoint> points);
    /// Another list: one step to undo.
    void replace(std::vector<waypoint> points);
    /// Discards the edits.
    void take_over(const std::vector<waypoint>& on_boat);

Q_SIGNALS:
    void changed();

private:
    void remember();
    void touched();

    std::vector<waypoint> points_;
    std::vector<std::vector<waypoint>> before_;
    bool edited_ = false;
    int selected_ = -1;
};

} // namespace atirma::console
