#include "chart_view.hpp"
#include "console_window.hpp"
#include "limits_dialog.hpp"
#include "mission_panel.hpp"

#include <QAction>
#include <QCloseEvent>
#include <QSplitter>
#include <QTabWidget>

#include <algorithm>

// The part of the window's state that outlives a restart.
namespace atirma::console {

void console_window::recall() {
    const auto& kept = remembered_;
    began_ = now();
    if (!kept.geometry.isEmpty()) restoreGeometry(kept.geometry); // moves it onto an existing screen
    if (!kept.split.isEmpty()) split_->restoreState(kept.split);
    if (!kept.tab.isEmpty()) show_tab(kept.tab);
    for (std::size_t boat = 0; boat < desks_.size(); ++boat)
        if (const auto& of = memory_of(remembered_, boat); of.draft_edited) desks_[boat].draft->restore(of.draft);
    follow_->setChecked(kept.follow);
    chart_->set_follow(kept.follow);
    chart_->set_tail(kept.tail_s);
    if (kept.chart_centre) chart_->place(*kept.chart_centre, kept.metres_per_pixel);
}

/// The first boat's is that of a console for one boat.
boat_memory& console_window::memory_of(console_memory& all, std::size_t boat) const {
    return boat == 0 ? all : all.more_boats[fleet_.name(boat)];
}

void console_window::keep_boat(std::size_t boat, boat_memory& into) const {
    const auto& desk = desks_[boat];
    if (desk.told) {
        const auto& alarms = fleet_.seen(boat)->alarms;
        bool settled = now() - began_ > std::chrono::minutes(10); // before that, the cause may not be known yet
        std::erase_if(into.acknowledged, [&](const auto& kept) {
            return settled || std::ranges::any_of(alarms, [&](const auto& it) { return it.key == kept.key; });
        });
        for (const auto& one : alarms)
            if (one.acknowledged && into.acknowledged.size() < alarm_book::max_alarms)
                into.acknowledged.push_back({one.key, one.how});
    }
    into.draft_edited = desk.draft->edited();
    into.draft = desk.draft->edited() ? desk.draft->points() : std::vector<waypoint>();
}

console_memory console_window::memory() const {
    auto made = remembered_;
    made.night = options_.night;
    made.red = red_;
    made.shown = shown_units();
    for (std::size_t boat = 0; boat < desks_.size(); ++boat) keep_boat(boat, memory_of(made, boat));
    made.geometry = saveGeometry();
    made.split = split_->saveState();
    made.tab = tabs_->currentWidget()->property("tab").toString();
    made.follow = chart_->following();
    made.tail_s = chart_->tail();
    if (chart_->placed()) {
        made.chart_centre = chart_->projection().centre;
        made.metres_per_pixel = chart_->projection().metres_per_pixel;
    }
    return made;
}

void console_window::keep() {
    auto trouble = settings_.save(memory());
    if (!trouble.isEmpty() && !std::exchange(settings_failed_, true)) say(trouble); // reported once
    if (trouble.isEmpty()) settings_failed_ = false;
}

void console_window::closeEvent(QCloseEvent* event) {
    keep();
    QMainWindow::closeEvent(event);
}

void console_window::set_units(const units& chosen) {
    use_units(chosen);
    mission_->forget();
    refresh();
}

void console_window::edit_limits() {
    limits_dialog dialog(remembered_.limits, this);
    if (dialog.exec() != QDialog::Accepted) return;
    remembered_.limits = dialog.limits();
    for (std::size_t boat = 0; boat < desks_.size(); ++boat) // the component that cannot take them yet gets them later
        desks_[boat].told = act_(boat, set_limits{dialog.limits()}) && desks_[boat].told;
    if (desks_[shown_].told) say(tr("The alarms use the new limits"));
}

} // namespace atirma::console
