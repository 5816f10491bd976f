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
    if (kept.draft_edited) draft().restore(kept.draft);
    follow_->setChecked(kept.follow);
    chart_->set_follow(kept.follow);
    chart_->set_tail(kept.tail_s);
    if (kept.chart_centre) chart_->place(*kept.chart_centre, kept.metres_per_pixel);
}

console_memory console_window::memory() const {
    auto made = remembered_;
    made.night = options_.night;
    made.red = red_;
    made.shown = shown_units();
    if (desks_[0].told) {
        bool settled = now() - began_ > std::chrono::minutes(10); // before that, the cause may not be known yet
        std::erase_if(made.acknowledged, [&](const auto& kept) {
            return settled ||
                   std::ranges::any_of(fleet_.seen(0)->alarms, [&](const auto& it) { return it.key == kept.key; });
        });
        for (const auto& one : fleet_.seen(0)->alarms)
            if (one.acknowledged && made.acknowledged.size() < alarm_book::max_alarms)
                made.acknowledged.push_back({one.key, one.how});
    }
    const auto& draft = *desks_[0].draft; // the file has the first boat's
    made.draft_edited = draft.edited();
    made.draft = draft.edited() ? draft.points() : std::vector<waypoint>();
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
