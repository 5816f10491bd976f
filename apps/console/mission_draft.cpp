#include "mission_draft.hpp"

#include <algorithm>

namespace atirma::console {
namespace {
constexpr std::size_t max_undos = 100;
}

void mission_draft::remember() {
    before_.push_back(points_);
    if (before_.size() > max_undos) before_.erase(before_.begin());
}

void mission_draft::touched() {
    edited_ = true;
    selected_ = std::min(selected_, static_cast<int>(points_.size()) - 1);
    Q_EMIT changed();
}

bool mission_draft::insert(std::size_t before, waypoint at) {
    if (points_.size() >= most) return false;
    remember();
    before = std::min(before, points_.size());
    points_.insert(points_.begin() + static_cast<std::ptrdiff_t>(before), at);
    selected_ = static_cast<int>(before);
    touched();
    return true;
}

void mission_draft::move(std::size_t index, waypoint to) {
    if (index >= points_.size()) return;
    remember();
    drag(index, to);
}

void mission_draft::drag(std::size_t index, waypoint to) {
    if (index >= points_.size()) return;
    points_[index] = to;
    touched();
}

void mission_draft::remove(std::size_t index) {
    if (index >= points_.size()) return;
    remember();
    points_.erase(points_.begin() + static_cast<std::ptrdiff_t>(index));
    touched();
}

void mission_draft::swap(std::size_t a, std::size_t b) {
    if (a >= points_.size() || b >= points_.size()) return;
    remember();
    std::swap(points_[a], points_[b]);
    selected_ = static_cast<int>(b);
    touched();
}

void mission_draft::clear() {
    remember();
    points_.clear();
    touched();
}

void mission_draft::undo() {
    if (before_.empty()) return;
    points_ = std::move(before_.back());
    before_.pop_back();
    touched();
}

void mission_draft::select(int index) {
    if (index == selected_) return;
    selected_ = index;
    Q_EMIT changed();
}

void mission_draft::follow(const std::vector<waypoint>& on_boat) {
    if (edited_ || points_ == on_boat) return;
    points_ = on_boat;
    selected_ = std::min(selected_, static_cast<int>(points_.size()) - 1);
    Q_EMIT changed();
}

void mission_draft::restore(std::vector<waypoint> points) {
    if (points.size() > most) points.resize(most);
    points_ = std::move(points);
    selected_ = -1;
    touched();
}

void mission_draft::replace(std::vector<waypoint> points) {
    remember();
    if (points.size() > most) points.resize(most);
    points_ = std::move(points);
    selected_ = -1;
    touched();
}

void mission_draft::take_over(const std::vector<waypoint>& on_boat) {
    if (points_ != on_boat) remember();
    points_ = on_boat;
    touched();
    edited_ = false;
    Q_EMIT changed();
}

} // namespace atirma::console
