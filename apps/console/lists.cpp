#include "lists.hpp"

#include "tables.hpp"
#include "theme.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/track_store.hpp>
#include <components/gui_client/words.hpp>

#include <ise/core/time_text.hpp>

#include <QHeaderView>
#include <QLabel>
#include <QPushButton>
#include <QTableWidget>
#include <QVBoxLayout>

#include <algorithm>
#include <utility>

namespace atirma::console {
namespace {

// The lines below the name of a telecommand.
QString details_of(const command_entry& of) {
    QStringList all;
    if (of.executed_at) all << QObject::tr("executed %1").arg(clock_of(*of.executed_at));
    if (!of.text.empty()) all << text(of.text);
    if (!of.called_back.empty() && of.called_back != of.text) all << text(of.called_back);
    return all.isEmpty() ? QString() : "\n" + all.join(" · ");
}

} // namespace

const QColor& colour_of(command_phase phase) {
    const auto& t = colours();
    if (phase == command_phase::done) return t.good;
    return is_over(phase) ? t.bad : t.warn;
}

QString phase_text(const command_entry& of, utc_time now) {
    auto words = text(std::string(name_of(of.phase)));
    if (is_over(of.phase) || !of.valid_until) return words;
    auto left = std::chrono::ceil<std::chrono::seconds>(*of.valid_until - now).count();
    if (left <= 0) return words;
    return left < 120 ? QObject::tr("%1, %2 s left").arg(words).arg(left)
                      : QObject::tr("%1, %2 min left").arg(words).arg((left + 59) / 60);
}

command_list::command_list(std::function<void(std::uint32_t)> call_back, QWidget* parent)
    : QWidget(parent), call_back_(std::move(call_back)) {
    table_ = make_table({tr("UTC"), tr("Command"), tr("State"), tr("By, link")}, "command_table", this);
    table_->setColumnWidth(0, 76);
    table_->setColumnWidth(2, 92);
    table_->setColumnWidth(3, 86);
    table_->horizontalHeader()->setStretchLastSection(false);
    table_->horizontalHeader()->setSectionResizeMode(1, QHeaderView::Stretch);
    table_->setWordWrap(true);
    // Not ResizeToContents, which measures all rows again for each changed cell.
    connect(table_->horizontalHeader(), &QHeaderView::sectionResized, table_, &QTableWidget::resizeRowsToContents);
    table_->setAccessibleName(tr("Telecommands"));
    empty_ = new QLabel(tr("No telecommand yet"), this);
    empty_->setAlignment(Qt::AlignCenter);
    empty_->setProperty("role", "small");
    auto* column = column_of(this);
    column->addWidget(table_, 1);
    column->addWidget(empty_, 1);
    auto* line = new QHBoxLayout;
    back_ = new QPushButton(tr("Call back"), this);
    back_->setObjectName("call_back");
    back_->setToolTip(tr("Stops the selected telecommand, if it has not left the shore yet"));
    line->addStretch(1);
    line->addWidget(back_);
    column->addLayout(line);
    connect(table_, &QTableWidget::itemSelectionChanged, this, &command_list::offer);
    connect(back_, &QPushButton::clicked, this, [this] {
        if (const auto* one = chosen()) call_back_(one->id);
    });
    offer();
}

const command_entry* command_list::chosen() const {
    auto row = table_->currentRow();
    if (!shown_ || row < 0 || static_cast<std::size_t>(row) >= shown_->size()) return nullptr;
    return &shown_->at(shown_->size() - 1 - static_cast<std::size_t>(row));
}

void command_list::offer() {
    const auto* one = chosen();
    back_->setEnabled(one && one->may_be_called_back());
}

/// New ones come at the top: the rows below move with their heights.
void command_list::make_rows(const std::vector<command_entry>& before) {
    std::size_t fresh = 0;
    if (!before.empty())
        while (fresh < shown_->size() && shown_->at(shown_->size() - 1 - fresh).id != before.back().id) ++fresh;
    if (fresh < shown_->size())
        for (; fresh > 0; --fresh) table_->insertRow(0);
    table_->setRowCount(static_cast<int>(shown_->size()));
}

void command_list::show_snapshot(const snapshot& seen, utc_time now) {
    bool runs = counts_ && std::chrono::abs(now - shown_at_) >= std::chrono::seconds(1);
    if (shown_ == seen.commands && !runs) return;
    const auto* before = chosen();
    auto chosen_id = before ? before->id : 0;
    auto shown_before = std::exchange(shown_, seen.commands);
    shown_at_ = now;
    counts_ = false;
    const auto& t = colours();
    table_->setVisible(!shown_->empty());
    empty_->setVisible(shown_->empty());
    make_rows(shown_before ? *shown_before : std::vector<command_entry>());
    int row = 0;
    for (auto it = shown_->rbegin(); it != shown_->rend(); ++it, ++row) {
        bool changed = false; // its height follows from its words
        auto tip = tr("%1\nid %2, %n attempt(s), last change %3", nullptr, static_cast<int>(it->attempts))
                       .replace("(s)", it->attempts == 1 ? "" : "s")
                       .arg(text(it->path))
                       .arg(it->id)
                       .arg(clock_of(it->changed_at));
        changed |= set_cell(table_, row, 0, clock_of(it->asked_at), t.ink3, tip);
        counts_ = counts_ || (!is_over(it->phase) && it->valid_until);
        if (it->valid_until) tip += tr("\nvalid until %1").arg(clock_of(*it->valid_until));
        if (it->executed_at) tip += tr("\nexecuted at %1").arg(clock_of(*it->executed_at));
        changed |= set_cell(table_, row, 1, text(it->what) + details_of(*it), t.ink);
        changed |= set_cell(table_, row, 2, "● " + phase_text(*it, now), colour_of(it->phase), tip);
        auto who = it->asked_by.empty() ? tr("other") : text(operator_label(it->asked_by));
        auto by = (it->own ? tr("here") : who) + (it->asked_as.empty() ? QString() : QStringLiteral(" ✓"));
        auto verified = it->asked_as.empty()             ? tr("identity not verified")
                        : it->asked_as.ends_with("/key") ? tr("a holder of the shared key, which names nobody")
                                                         : tr("verified as %1").arg(text(it->asked_as));
        if (it->link) by += "\n" + text(label(*it->link));
        changed |= set_cell(table_, row, 3, by, it->own ? t.ink2 : t.accent,
                            (it->own ? tr("sent from this console") : tr("sent by: %1").arg(text(it->asked_by))) +
                                "\n" + verified + "\n" + text(it->path));
        if (changed) table_->resizeRowToContents(row);
        if (it->id == chosen_id) table_->setCurrentCell(row, 0);
    }
    offer();
}

present_list::present_list(QWidget* parent) : QWidget(parent) {
    auto* column = column_of(this);
    head_ = rich_label(this);
    head_->setObjectName("present_head");
    head_->setWordWrap(true);
    column->addWidget(head_);
    table_ =
        make_table({tr("Component"), tr("State"), tr("Host"), tr("Process"), tr("Seen for")}, "present_table", this);
    table_->setAccessibleName(tr("Components"));
    table_->setColumnWidth(0, 206);
    table_->setColumnWidth(1, 72);
    table_->setColumnWidth(2, 62);
    table_->setColumnWidth(3, 58);
    column->addWidget(table_, 1);
}

void present_list::show_snapshot(const snapshot& seen, utc_time now) {
    const auto& t = colours();
    QStringList others;
    for (const auto& one : *seen.present)
        if (one.console && !one.self) others << text(one.path.substr(one.path.rfind('/') + 1));
    auto where = text(seen.finding.where).toHtmlEscaped();
    auto names =
        seen.finding.uses_names
            ? seen.finding.reached
                  ? tr("Name server: %1").arg(where)
                  : tr("<span style='color:%1'>● The name server at %2 is not reached</span>").arg(t.bad.name(), where)
            : tr("Without a name server: %1").arg(where);
    head_->setText((others.isEmpty() ? tr("No other operator")
                                     : tr("Other operators: <b>%1</b>").arg(others.join(", ").toHtmlEscaped())) +
                   "<br>" + names);
    table_->setRowCount(static_cast<int>(seen.present->size()));
    int row = 0;
    for (const auto& one : *seen.present) {
        bool commands = seen.authority.known && one.path == seen.authority.state.holder;
        auto name = text(one.path) + (one.self ? tr("  (this one)") : QString()) +
                    (commands ? tr("  ⚑ has the authority") : QString());
        set_cell(table_, row, 0, name, one.console ? t.accent : t.ink,
                 text(one.path + (one.type.empty() ? "" : "\n" + one.type)));
        set_cell(table_, row, 1, "● " + text(one.state), one.state == "ready" ? t.good : t.warn);
        set_cell(table_, row, 2, text(one.host), t.ink2);
        set_cell(table_, row, 3, QString::number(one.process_id), t.ink2);
        set_cell(table_, row, 4, text(age_text(age_s(now, one.since))), t.ink3);
        ++row;
    }
}

alarm_list::alarm_list(std::function<bool(const std::string&)> acknowledge, QWidget* parent)
    : QWidget(parent), acknowledge_(std::move(acknowledge)) {
    auto* column = column_of(this);
    empty_ = new QLabel(tr("No alarms"), this);
    empty_->setAlignment(Qt::AlignCenter);
    empty_->setProperty("role", "small");
    table_ = make_table({tr("Since"), tr("Alarm"), tr("State")}, "alarm_table", this);
    table_->setColumnWidth(0, 76);
    table_->horizontalHeader()->setStretchLastSection(false);
    table_->horizontalHeader()->setSectionResizeMode(1, QHeaderView::Stretch);
    table_->setColumnWidth(2, 112);
    table_->setWordWrap(true);
    table_->setAccessibleName(tr("Alarms"));
    column->addWidget(table_, 1);
    column->addWidget(empty_);
    log_ = make_table({tr("UTC"), tr("Alarm"), tr("Event")}, "alarm_log", this);
    log_->setColumnWidth(0, 76);
    log_->horizontalHeader()->setStretchLastSection(false);
    log_->horizontalHeader()->setSectionResizeMode(1, QHeaderView::Stretch);
    log_->setColumnWidth(2, 112);
    log_->setWordWrap(true);
    // Not ResizeToContents, which measures all rows again for each changed cell.
    connect(log_->horizontalHeader(), &QHeaderView::sectionResized, this, [this] { measure_log(); });
    log_->setAccessibleName(tr("Log of alarms"));
    log_->hide();
    column->addWidget(log_, 1);
    auto* line = new QHBoxLayout;
    log_button_ = new QPushButton(tr("Log"), this);
    log_button_->setObjectName("show_alarm_log");
    log_button_->setCheckable(true);
    log_button_->setToolTip(tr("What happened to the alarms: raised, over, acknowledged"));
    connect(log_button_, &QPushButton::toggled, this, [this](bool on) {
        log_->setVisible(on);
        table_->setVisible(!on && !keys_.empty());
        empty_->setVisible(!on && keys_.empty());
        if (on && !log_measured_) measure_log();
        if (!on) table_->resizeRowsToContents();
    });
    line->addWidget(log_button_);
    auto* one = new QPushButton(tr("Acknowledge"), this);
    one->setObjectName("acknowledge_one");
    auto* all = new QPushButton(tr("Acknowledge all"), this);
    all->setObjectName("acknowledge_all");
    all->setToolTip(tr("Ctrl+K"));
    line->addStretch(1);
    line->addWidget(one);
    line->addWidget(all);
    column->addLayout(line);
    connect(one, &QPushButton::pressed, this, [this] { pressed_ = chosen(); });
    connect(one, &QPushButton::clicked, this, [this] {
        if (auto key = std::exchange(pressed_, {}); !key.empty()) acknowledge_(key);
    });
    connect(all, &QPushButton::clicked, this, &alarm_list::acknowledge_all);
}

std::string alarm_list::chosen() const {
    auto row = table_->currentRow();
    return row >= 0 && static_cast<std::size_t>(row) < keys_.size() ? keys_[static_cast<std::size_t>(row)]
                                                                    : std::string();
}

void alarm_list::acknowledge_all() {
    for (const auto& key : std::vector(open_))
        if (!acknowledge_(key)) return;
}

void alarm_list::show_snapshot(const snapshot& seen, utc_time) {
    const auto& t = colours();
    bool any = !seen.alarms.empty();
    table_->setVisible(any && !log_button_->isChecked());
    empty_->setVisible(!any && !log_button_->isChecked());
    show_log(seen);
    auto before = chosen();
    bool still_there = std::ranges::any_of(seen.alarms, [&](const auto& one) { return one.key == before; });
    if (!still_there) table_->setCurrentCell(-1, -1); // else another alarm would take its place
    keys_.clear();
    open_.clear();
    table_->setRowCount(static_cast<int>(seen.alarms.size()));
    int row = 0;
    for (const auto& one : seen.alarms) {
        auto ink = one.acknowledged || one.over_at ? t.ink2 : t.of(one.how);
        set_cell(table_, row, 0, clock_of(one.raised_at), t.ink3);
        set_cell(table_, row, 1, text(one.text), ink);
        set_cell(table_, row, 2,
                 one.over_at        ? tr("over %1").arg(clock_of(*one.over_at).left(5))
                 : one.acknowledged ? tr("acknowledged")
                                    : tr("● now"),
                 one.over_at ? t.good : ink);
        if (one.key == before) table_->setCurrentCell(row, 1);
        keys_.push_back(one.key);
        if (!one.acknowledged) open_.push_back(one.key);
        ++row;
    }
    if (table_->isVisible()) table_->resizeRowsToContents(); // shows the full text of an alarm
}

/// Its rows as high as their words, which takes long for hundreds of them: not while nobody sees it.
void alarm_list::measure_log() {
    log_measured_ = log_->isVisible();
    if (log_measured_) log_->resizeRowsToContents();
}

/// New events come at the top: the rows below move with their heights, and an event does not change.
void alarm_list::show_log(const snapshot& seen) {
    if (log_->isVisible() && !log_measured_) measure_log();
    if (!seen.alarm_log || logged_ == seen.alarm_log) return;
    auto before = std::exchange(logged_, seen.alarm_log);
    auto many = static_cast<int>(logged_->size()), fresh = many;
    if (before && !before->empty()) {
        const auto& last = before->back();
        int newer = 0;
        for (auto it = logged_->rbegin(); it != logged_->rend() && it->number > last.number; ++it) ++newer;
        // Else its component has started again, and counts from 1.
        if (newer < many && (*logged_)[static_cast<std::size_t>(many - 1 - newer)].at == last.at) fresh = newer;
    }
    if (fresh < many)
        for (int row = 0; row < fresh; ++row) log_->insertRow(0);
    log_->setRowCount(many);
    const auto& t = colours();
    log_measured_ = log_measured_ && log_->isVisible();
    for (int row = 0; row < fresh; ++row) {
        const auto& one = (*logged_)[static_cast<std::size_t>(many - 1 - row)];
        bool grave = one.what == alarm_change::raised || one.what == alarm_change::more_severe;
        auto ink = grave ? t.of(one.how) : t.ink2;
        set_cell(log_, row, 0, clock_of(one.at), t.ink3, text(ise::iso_8601(one.at, 3)));
        set_cell(log_, row, 1, text(one.text), ink);
        set_cell(log_, row, 2, text(std::string(name_of(one.what))), t.ink2, text(std::string(name_of(one.how))));
        if (log_measured_) log_->resizeRowToContents(row);
    }
}

} // namespace atirma::console
