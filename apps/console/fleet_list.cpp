#include "fleet_list.hpp"

#include "boat_words.hpp"
#include "tables.hpp"
#include "theme.hpp"

#include <components/gui_client/freshness.hpp>

#include <QHBoxLayout>
#include <QHeaderView>
#include <QPushButton>
#include <QTableWidget>
#include <QVBoxLayout>

namespace atirma::console {

fleet_list::fleet_list(std::function<void(std::size_t)> show, QWidget* parent)
    : QWidget(parent), show_(std::move(show)) {
    auto* column = column_of(this);
    table_ = make_table({tr("Boat"), tr("State"), tr("Heard"), tr("Mode"), tr("Alarms")}, "fleet_table", this);
    table_->setAccessibleName(tr("Boats"));
    table_->setColumnWidth(0, 92);
    table_->setColumnWidth(1, 126);
    table_->setColumnWidth(2, 58);
    table_->setColumnWidth(3, 84);
    column->addWidget(table_, 1);
    auto* line = new QHBoxLayout;
    show_button_ = new QPushButton(tr("Show this boat"), this);
    show_button_->setObjectName("show_boat");
    show_button_->setToolTip(tr("Shows the selected boat: chart, lists and commands are then its own"));
    line->addStretch(1);
    line->addWidget(show_button_);
    column->addLayout(line);
    auto show_row = [this](int row) {
        if (row >= 0) show_(static_cast<std::size_t>(row));
    };
    // Queued: these widgets are replaced by the switch.
    connect(
        table_, &QTableWidget::cellActivated, this, [show_row](int row, int) { show_row(row); }, Qt::QueuedConnection);
    connect(
        show_button_, &QPushButton::clicked, this, [this, show_row] { show_row(table_->currentRow()); },
        Qt::QueuedConnection);
    connect(table_, &QTableWidget::itemSelectionChanged, this, &fleet_list::offer);
    offer();
}

QWidget* fleet_list::focus() const { return table_; }

void fleet_list::offer() {
    auto row = table_->currentRow();
    show_button_->setEnabled(row >= 0 && static_cast<std::size_t>(row) != shown_);
}

void fleet_list::show_fleet(const fleet_watch& fleet, std::size_t shown, utc_time now) {
    const auto& t = colours();
    bool first = table_->rowCount() == 0;
    shown_ = shown;
    table_->setRowCount(static_cast<int>(fleet.size()));
    for (std::size_t boat = 0; boat < fleet.size(); ++boat) {
        auto row = static_cast<int>(boat);
        const auto& seen = *fleet.seen(boat);
        auto name = text(fleet.name(boat));
        set_cell(table_, row, 0, boat == shown ? "▸ " + name : name, boat == shown ? t.accent : t.ink, name);
        const auto& ended = fleet.ended(boat);
        auto state = ended.empty() ? state_of(seen, now) : state_of_ended();
        set_cell(table_, row, 1, "● " + state.words, state.ink,
                 !ended.empty()        ? text(ended)
                 : state.age.isEmpty() ? state.words
                                       : tr("%1; the position is %2 old").arg(state.words, state.age));
        const auto& heard = seen.boat.last_heard;
        set_cell(table_, row, 2, heard ? text(age_text(age_s(now, *heard))) : QStringLiteral("–"), t.ink2,
                 heard ? tr("last contact at %1").arg(clock_of(*heard)) : tr("not heard yet"));
        set_cell(table_, row, 3, mode_words(seen, now), t.ink2);
        auto open = count_open(seen);
        auto ink = open.worst ? t.of(open.worst->how) : t.ink3;
        set_cell(table_, row, 4, open.worst ? QStringLiteral("● %1").arg(open.count) : QStringLiteral("–"), ink,
                 open.worst ? text(open.worst->text) : tr("no open alarm"));
    }
    if (first) table_->setCurrentCell(static_cast<int>(shown), 0);
    offer();
}

} // namespace atirma::console
