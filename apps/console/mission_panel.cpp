#include "mission_panel.hpp"

#include "chart_view.hpp"
#include "hold_button.hpp"
#include "theme.hpp"
#include "units.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/mission.hpp>

#include <QGridLayout>
#include <QHeaderView>
#include <QLabel>
#include <QProgressBar>
#include <QPushButton>
#include <QTableWidget>

#include <initializer_list>
#include <utility>

namespace atirma::console {

mission_panel::mission_panel(mission_draft& draft, operator_actions& actions, QWidget* parent)
    : QWidget(parent), draft_(draft), actions_(actions) {
    auto* column = new QVBoxLayout(this);
    column->setContentsMargins(0, 2, 0, 0);
    column->setSpacing(5);
    state_ = rich_label(this);
    state_->setObjectName("mission_state");
    state_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Fixed); // one line, whatever it says
    column->addWidget(state_);
    table_ = new QTableWidget(0, 4, this);
    table_->setObjectName("mission_table");
    table_->setAccessibleName(tr("Waypoints"));
    table_->setTabKeyNavigation(false);
    table_->setHorizontalHeaderLabels({tr("Latitude °"), tr("Longitude °"), tr("Leg"), tr("On the boat")});
    table_->horizontalHeader()->setSectionResizeMode(QHeaderView::Stretch);
    for (int n = 0; n < 4; ++n)
        table_->horizontalHeaderItem(n)->setTextAlignment(Qt::AlignVCenter | (n < 3 ? Qt::AlignRight : Qt::AlignLeft));
    table_->verticalHeader()->setDefaultSectionSize(25);
    table_->setSelectionBehavior(QAbstractItemView::SelectRows);
    table_->setSelectionMode(QAbstractItemView::SingleSelection);
    table_->setShowGrid(false);
    table_->setAlternatingRowColors(true);
    column->addWidget(table_, 1);
    auto* rows = new QGridLayout;
    rows->setSpacing(4);
    new_ = button("new_list", tr("New"), tr("Begins a new list: click its waypoints on the chart (Ctrl+Shift+E)"));
    edit_ = button("edit", tr("Edit"), tr("Click on the chart adds, drag moves, right click or Del removes (Ctrl+E)"));
    edit_->setCheckable(true);
    remove_ = button("remove", tr("Delete"), tr("Removes the selected waypoint"));
    up_ = button("up", "↑", tr("Earlier in the list"));
    down_ = button("down", "↓", tr("Later in the list"));
    undo_ = button("undo", tr("Undo"), tr("Reverts the last change (Ctrl+Z)"));
    upload_ = new hold_button(tr("Hold to upload"), this);
    upload_->setObjectName("upload");
    upload_->setToolTip(tr("Held for a second, sends this list to the boat, reads it back and compares (Ctrl+U asks)"));
    upload_->setProperty("role", "primary");
    read_ = button("read_back", tr("Read back"), tr("Requests the boat's list (Ctrl+B)"));
    take_over_ = button("take_over", tr("As on boat"), tr("Discards the edits"));
    go_ =
        button("go", tr("Sail to"), tr("The boat sails to the selected waypoint, where its own list has the same one"));
    cancel_ = button("cancel_upload", tr("Stop"), tr("Stops the upload after the telecommand in transit"));
    rows->addWidget(new_, 0, 0);
    rows->addWidget(edit_, 0, 1);
    rows->addWidget(remove_, 0, 2);
    rows->addWidget(up_, 0, 3);
    rows->addWidget(down_, 0, 4);
    rows->addWidget(undo_, 0, 5);
    rows->addWidget(upload_, 1, 0, 1, 2);
    rows->addWidget(read_, 1, 2);
    rows->addWidget(take_over_, 1, 3, 1, 2);
    rows->addWidget(go_, 1, 5);
    column->addLayout(rows);
    auto* line = new QHBoxLayout;
    progress_ = new QProgressBar(this);
    progress_->setTextVisible(false);
    progress_->setAccessibleName(tr("Upload"));
    progress_->setMaximumWidth(110);
    progress_text_ = rich_label(this);
    progress_text_->setObjectName("upload_state");
    progress_text_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
    for (QWidget* each : std::initializer_list<QWidget*>{progress_, progress_text_, cancel_}) {
        auto kept = each->sizePolicy();
        kept.setRetainSizeWhenHidden(true); // the buttons above stay where they are
        each->setSizePolicy(kept);
        line->addWidget(each, each == progress_text_ ? 1 : 0);
    }
    column->addLayout(line);
    connect(&draft_, &mission_draft::changed, this, &mission_panel::fill);
    connect(table_, &QTableWidget::cellChanged, this, &mission_panel::cell_edited);
    connect(table_, &QTableWidget::itemSelectionChanged, this, [this] {
        if (!filling_) draft_.select(table_->currentRow());
    });
    connect(edit_, &QPushButton::toggled, this, &mission_panel::edit_wanted);
    auto chosen = [this] { return static_cast<std::size_t>(std::max(0, draft_.selected())); };
    connect(remove_, &QPushButton::clicked, this, [this, chosen] { draft_.remove(chosen()); });
    connect(up_, &QPushButton::clicked, this, [this, chosen] { draft_.swap(chosen(), chosen() - 1); });
    connect(down_, &QPushButton::clicked, this, [this, chosen] { draft_.swap(chosen(), chosen() + 1); });
    connect(undo_, &QPushButton::clicked, &draft_, &mission_draft::undo);
    connect(upload_, &QPushButton::clicked, this, [this] {
        actions_.upload(draft_.points(), seen_ ? seen_->mission.points : std::vector<waypoint>(), true);
    });
    connect(new_, &QPushButton::clicked, this, &mission_panel::begin_new);
    connect(read_, &QPushButton::clicked, this, [this] { actions_.give(commands::waypoint_read_back()); });
    connect(cancel_, &QPushButton::clicked, this, [this] { actions_.act(cancel_upload()); });
    connect(take_over_, &QPushButton::clicked, this, [this] {
        if (seen_) draft_.take_over(seen_->mission.points);
    });
    connect(go_, &QPushButton::clicked, this,
            [this, chosen] { actions_.give(commands::waypoint_select{static_cast<std::uint8_t>(chosen())}); });
    fill();
}

QPushButton* mission_panel::button(const QString& name, const QString& label, const QString& tip) {
    auto* made = new QPushButton(label, this);
    made->setObjectName(name);
    made->setToolTip(tip);
    if (label.size() == 1) made->setAccessibleName(tip); // an arrow
    made->setMinimumWidth(30);
    return made;
}

void mission_panel::begin_new() {
    draft_.clear();
    set_editing(true);
    Q_EMIT edit_wanted(true);
}

void mission_panel::set_editing(bool on) {
    if (edit_->isChecked() != on) edit_->setChecked(on);
}

void mission_panel::allow_commands(bool allowed) {
    if (std::exchange(allowed_, allowed) != allowed) fill_state();
}

void mission_panel::show_snapshot(std::shared_ptr<const snapshot> seen, utc_time now) {
    bool news =
        !seen_ || seen_->mission.points != seen->mission.points || seen_->mission.complete != seen->mission.complete;
    auto was = seen_ ? seen_->upload.phase : upload_phase::none;
    seen_ = std::move(seen);
    now_ = now;
    if (seen_->mission.complete) draft_.follow(seen_->mission.points);
    // After a verified upload this is the boat's list again.
    if (was != seen_->upload.phase && seen_->upload.phase == upload_phase::verified &&
        same(seen_->mission.points, draft_.points()))
        draft_.take_over(seen_->mission.points);
    if (news) fill();
    else fill_state();
}

void mission_panel::fill() {
    filling_ = true;
    const auto& points = draft_.points();
    auto boat = seen_ && seen_->mission.complete ? seen_->mission.points : std::vector<waypoint>();
    bool known = seen_ && seen_->mission.complete;
    auto all = compare(boat, points);
    const auto& t = colours();
    table_->setRowCount(static_cast<int>(all.size()));
    for (std::size_t i = 0; i < all.size(); ++i) {
        int row = static_cast<int>(i);
        bool here = i < points.size();
        const auto& at = here ? points[i] : boat[i];
        auto leg = here && i > 0 ? QStringLiteral("%1 %2").arg(distance_text(distance_m(points[i - 1], at)),
                                                               bearing_text(bearing_deg(points[i - 1], at)))
                                 : QString();
        QString there = known ? tr("same") : tr("not known");
        if (known && all[i].what == difference::moved) there = tr("%1 away").arg(distance_text(all[i].moved_m));
        if (known && all[i].what == difference::only_here) there = tr("only here");
        if (known && all[i].what == difference::only_on_boat) there = tr("only there");
        QStringList cells{QString::number(at.latitude_deg, 'f', 6), QString::number(at.longitude_deg, 'f', 6), leg,
                          there};
        for (int column = 0; column < 4; ++column) {
            auto* item = new QTableWidgetItem(cells[column]);
            bool editable = here && column < 2;
            item->setFlags(Qt::ItemIsEnabled | Qt::ItemIsSelectable |
                           (editable ? Qt::ItemIsEditable : Qt::NoItemFlags));
            item->setTextAlignment(Qt::AlignVCenter | (column < 3 ? Qt::AlignRight : Qt::AlignLeft));
            if (!here || column == 2) item->setForeground(t.ink3);
            if (column == 3) item->setForeground(!known ? t.ink3 : all[i].what == difference::same ? t.good : t.warn);
            table_->setItem(row, column, item);
        }
    }
    if (draft_.selected() >= 0) table_->selectRow(draft_.selected());
    else table_->clearSelection();
    filling_ = false;
    fill_state();
}

void mission_panel::fill_state() {
    const auto& t = colours();
    auto dot = [](const QColor& colour) {
        return QStringLiteral("<span style='color:%1'>●</span> ").arg(colour.name());
    };
    bool known = seen_ && seen_->mission.complete;
    QString words, tooltip;
    if (!known) {
        words = dot(t.ink3) + tr("The boat's list is not known yet");
    } else {
        auto age = text(age_text(age_s(now_, *seen_->mission.told_at)));
        tooltip = tr("the boat reported its list of %1: %2")
                      .arg(seen_->mission.points.size())
                      .arg(age == "now" ? age : tr("%1 ago").arg(age));
        bool equal = same(seen_->mission.points, draft_.points());
        words = equal
                    ? dot(t.good) + tr("As on the boat")
                    : dot(t.warn) +
                          tr("Edited here: %1").arg(text(describe_differences(seen_->mission.points, draft_.points())));
        words += QStringLiteral(" <span style='color:%1'>· %2</span>").arg(t.ink3.name(), tooltip);
    }
    state_->setText(words);
    state_->setToolTip(tooltip);
    int chosen = draft_.selected(), many = static_cast<int>(draft_.points().size());
    bool runs = seen_ && is_running(seen_->upload.phase);
    remove_->setEnabled(chosen >= 0 && chosen < many);
    up_->setEnabled(chosen > 0);
    down_->setEnabled(chosen >= 0 && chosen + 1 < many);
    undo_->setEnabled(draft_.can_undo());
    bool nothing = draft_.points().empty() && !draft_.edited() && !known; // nobody has said that the list is empty
    upload_->setEnabled(allowed_ && !runs && !nothing);
    read_->setEnabled(allowed_);
    cancel_->setEnabled(allowed_);
    take_over_->setEnabled(known && draft_.edited());
    // The command has the place in the boat's list: it must be the same waypoint there.
    auto both = known ? compare(seen_->mission.points, draft_.points()) : std::vector<mission_difference>();
    bool there = chosen >= 0 && static_cast<std::size_t>(chosen) < both.size() &&
                 both[static_cast<std::size_t>(chosen)].what == difference::same;
    go_->setEnabled(allowed_ && there);
    auto phase = seen_ ? seen_->upload.phase : upload_phase::none;
    cancel_->setVisible(runs);
    progress_->setVisible(runs);
    progress_text_->setVisible(phase != upload_phase::none);
    if (phase == upload_phase::none) return;
    progress_->setRange(0, static_cast<int>(seen_->upload.total) + 1);
    progress_->setValue(static_cast<int>(seen_->upload.done) + (phase == upload_phase::reading_back ? 1 : 0));
    auto colour = phase == upload_phase::verified ? t.good : runs ? t.warn : t.bad;
    progress_text_->setText(dot(colour) +
                            (phase == upload_phase::verified ? tr("Uploaded and verified: ") : QString()) +
                            text(seen_->upload.text).toHtmlEscaped());
    progress_text_->setToolTip(text(seen_->upload.text));
}

void mission_panel::cell_edited(int row, int column) {
    if (filling_ || column > 1 || row >= static_cast<int>(draft_.points().size())) return;
    bool good = false;
    double value = QLocale::c().toDouble(table_->item(row, column)->text().trimmed(), &good);
    if (!good || std::abs(value) > (column == 0 ? 90 : 180)) {
        auto typed = table_->item(row, column)->text().trimmed();
        Q_EMIT actions_.said(column == 0 ? tr("Not changed: a latitude is -90 to 90 degrees, not “%1”").arg(typed)
                                         : tr("Not changed: a longitude is -180 to 180 degrees, not “%1”").arg(typed));
        fill(); // as it was
        return;
    }
    auto to = draft_.points()[static_cast<std::size_t>(row)];
    (column == 0 ? to.latitude_deg : to.longitude_deg) = value;
    // Later: the editor of the cell still uses the table.
    QMetaObject::invokeMethod(
        this, [this, row, to] { draft_.move(static_cast<std::size_t>(row), to); }, Qt::QueuedConnection);
}

} // namespace atirma::console
