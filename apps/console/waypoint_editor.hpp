#pragma once
#include "chart_projection.hpp"
#include "mission_draft.hpp"

#include <cstddef>
#include <optional>

class QPainter;

namespace atirma::console {

/// The waypoints that are edited, on the chart.
class waypoint_editor {
public:
    /// Both outlive it.
    waypoint_editor(mission_draft& draft, const chart_projection& projection)
        : draft_(draft), projection_(projection) {}

    bool on() const noexcept { return on_; }
    void set(bool on) noexcept { on_ = on; }

    /// Selects the waypoint at `pixel`. False: there is none.
    bool select(QPointF pixel);
    /// The same, and `drag` moves it until `drop`.
    void grab(QPointF pixel);
    /// False: there is none at `pixel`.
    bool remove(QPointF pixel);
    bool holds() const noexcept { return held_.has_value(); }
    void drag(QPointF pixel);
    void drop() noexcept { held_.reset(); }
    /// Behind the selected one, or last. False: the list is full.
    bool insert(const waypoint& place);
    /// False: none is selected.
    bool remove_selected();
    void paint(QPainter& to) const;

private:
    std::optional<std::size_t> waypoint_at(QPointF pixel) const;

    mission_draft& draft_;
    const chart_projection& projection_;
    bool on_ = false;
    std::optional<std::size_t> held_;
    bool moved_ = false; ///< the held one
};

} // namespace atirma::console
