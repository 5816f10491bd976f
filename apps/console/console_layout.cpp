#include "console_window.hpp"

#include "boat_panel.hpp"
#include "chart_view.hpp"
#include "command_button.hpp"
#include "instruments.hpp"
#include "links_panel.hpp"
#include "lists.hpp"
#include "mission_panel.hpp"
#include "theme.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/track_store.hpp>
#include <components/gui_client/words.hpp>

#include <QHBoxLayout>
#include <QLabel>
#include <QMenuBar>
#include <QPushButton>
#include <QTabBar>
#include <QTabWidget>
#include <QToolButton>

// The parts of the window: head, alarm strip, side, the chart's tools.
namespace atirma::console {
namespace {

QString pill(const QColor& ink, const QColor& back) {
    return QStringLiteral(
               "QLabel { color: %1; background: %2; border-radius: 10px; padding: 2px 10px; font-weight: 600; }")
        .arg(ink.name(), back.name());
}

} // namespace

QWidget* console_window::make_head() {
    auto* head = new QWidget(this);
    auto* row = new QHBoxLayout(head);
    row->setContentsMargins(6, 3, 12, 3);
    row->setSpacing(8);
    record_mark_ = new QLabel(head);
    mode_ = new QLabel(head);
    mode_->setObjectName("mode");
    status_ = new QLabel(head);
    status_->setObjectName("status");
    clock_ = new QLabel(head);
    clock_->setObjectName("clock");
    clock_->setFont(font_of(14, QFont::DemiBold));
    clock_->setToolTip(tr("Coordinated universal time"));
    auto* name = new QLabel(options_.boat_name, head);
    name->setFont(font_of(15, QFont::Bold));
    command_ = new command_button(actions_, head);
    for (QWidget* each : std::initializer_list<QWidget*>{record_mark_, name, status_, mode_, command_, clock_})
        row->addWidget(each);
    return head;
}

void console_window::show_head(utc_time at) {
    const auto& t = colours();
    const auto& boat = seen_->boat;
    auto how = freshness_of(boat.position, value_kind::position, boat, at);
    QString words = tr("no boat yet");
    QColor ink = t.ink3, back = t.field;
    if (how != freshness::none) {
        auto age = text(age_text(age_s(at, boat.position->measured_at)));
        auto link = text(label(boat.position->link));
        words = how == freshness::fresh    ? tr("live · %1 · %2").arg(link, age)
                : how == freshness::ageing ? tr("ageing · %1 · %2").arg(link, age)
                                           : tr("no current data · %1").arg(age);
        ink = t.of(how);
        back = how == freshness::fresh ? t.field : how == freshness::ageing ? t.warn_back : t.bad_back;
    }
    status_->setText("● " + words);
    status_->setStyleSheet(pill(ink, back));
    bool known = boat.sailing.has_value();
    mode_->setVisible(known);
    if (known) {
        bool irons = boat.sailing->value.in_irons;
        mode_->setText(text(label(boat.sailing->value.mode)) + (irons ? tr(" · in irons") : QString()));
        mode_->setStyleSheet(pill(irons ? t.bad : t.accent, irons ? t.bad_back : t.notice_back));
    }
    record_mark_->setVisible(recorder_.running());
    record_mark_->setText(tr("● REC %1").arg(recorder_.written()));
    record_mark_->setStyleSheet(pill(t.bad, t.bad_back));
    clock_->setText(text(iso_time(at).substr(11, 8)) + " UTC");
    auto* corner = clock_->parentWidget();
    if (corner->minimumWidth() != corner->sizeHint().width()) { // the menu bar does not update by itself
        corner->setMinimumWidth(corner->sizeHint().width());
        menuBar()->setCornerWidget(corner, Qt::TopRightCorner);
    }
}

QWidget* console_window::make_alarm_strip() {
    strip_ = new QFrame(this);
    strip_->setObjectName("alarm_strip");
    auto* row = new QHBoxLayout(strip_);
    row->setContentsMargins(12, 3, 5, 3);
    strip_text_ = new QLabel(strip_);
    strip_text_->setObjectName("alarm_text");
    strip_text_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
    strip_text_->setAccessibleName(tr("Alarm"));
    auto* more = new QPushButton(tr("Show"), strip_);
    connect(more, &QPushButton::clicked, this, [this] { show_tab("alarms"); });
    auto* acknowledge = new QPushButton(tr("Acknowledge"), strip_);
    acknowledge->setObjectName("acknowledge_first");
    acknowledge->setToolTip(tr("Acknowledges this alarm; it stays in the list until its cause is gone"));
    connect(acknowledge, &QPushButton::clicked, this, [this] {
        if (!seen_->alarms.empty()) actions_.act(acknowledge_alarm{seen_->alarms.front().key});
    });
    row->addWidget(strip_text_, 1);
    row->addWidget(more);
    row->addWidget(acknowledge);
    strip_->hide();
    return strip_;
}

void console_window::show_alarm_strip() {
    const auto& t = colours();
    const auto& all = seen_->alarms;
    auto open = std::count_if(all.begin(), all.end(), [](const auto& one) { return !one.acknowledged; });
    strip_->setVisible(open > 0);
    auto place = tabs_->indexOf(alarms_);
    tabs_->setTabText(place, all.empty() ? tr("Alarms") : tr("Alarms %1").arg(all.size()));
    tabs_->tabBar()->setTabTextColor(place, open > 0 ? t.bad : QColor());
    if (open == 0) return;
    const auto& first = all.front(); // unacknowledged ones come first
    auto ink = first.how == severity::critical ? t.bad : first.how == severity::warning ? t.warn : t.accent;
    auto back = first.how == severity::critical  ? t.bad_back
                : first.how == severity::warning ? t.warn_back
                                                 : t.notice_back;
    strip_->setStyleSheet(
        QStringLiteral(
            "QFrame#alarm_strip { background: %1; border-radius: 9px; } QLabel { color: %2; font-weight: 600; }")
            .arg(back.name(), ink.name()));
    auto words = QStringLiteral("%1  %2").arg(text(iso_time(first.raised_at).substr(11, 8)), text(first.text));
    if (first.over_at) words += tr("  (over)");
    if (open > 1) words += tr("   + %1 more").arg(open - 1);
    strip_text_->setText(words);
    strip_text_->setToolTip(text(first.text));
}

QWidget* console_window::make_side() {
    auto* side = new QWidget(this);
    auto* column = new QVBoxLayout(side);
    column->setContentsMargins(0, 0, 0, 0);
    column->setSpacing(6);
    column->addWidget(instruments_, 4);
    tabs_ = new QTabWidget(side);
    tabs_->setObjectName("tabs");
    tabs_->setDocumentMode(true);
    tabs_->tabBar()->setAccessibleName(tr("Lists"));
    tabs_->tabBar()->setDrawBase(false);
    tabs_->tabBar()->setExpanding(false);
    tabs_->tabBar()->setElideMode(Qt::ElideNone);
    mission_ = new mission_panel(draft_, actions_, tabs_);
    links_ = new links_panel(actions_, tabs_);
    boat_ = new boat_panel(actions_, tabs_);
    log_ = new command_list([this](std::uint32_t id) { actions_.act(call_back_command{id}); }, tabs_);
    alarms_ = new alarm_list([this](const std::string& key) { actions_.act(acknowledge_alarm{key}); }, tabs_);
    packets_ = new packet_list(tabs_);
    present_ = new present_list(tabs_);
    const std::tuple<QWidget*, const char*, QString, QString> all[] = {
        {mission_, "mission", tr("Mission"), tr("Waypoints: edit, upload, read back, compare (F1)")},
        {links_, "links", tr("Links"), tr("The links to the boat, and the modem (F2)")},
        {boat_, "boat", tr("Boat"), tr("Parameters, periods, beacon, reboot (F3)")},
        {log_, "log", tr("Log"), tr("Telecommands of all operators (F4)")},
        {alarms_, "alarms", tr("Alarms"), tr("Active alarms (F5)")},
        {packets_, "packets", tr("Packets"), tr("Received packets (F6)")},
        {present_, "who", tr("Who"), tr("Components and other operators (F7)")},
    };
    for (const auto& [widget, name, label, tip] : all) {
        widget->setProperty("tab", name);
        tabs_->setTabToolTip(tabs_->addTab(widget, label), tip);
    }
    connect(tabs_, &QTabWidget::currentChanged, this, [this] { refresh(); });
    column->addWidget(tabs_, 7);
    side->setMinimumWidth(392);
    side->setMaximumWidth(640);
    return side;
}

void console_window::make_chart_tools() {
    auto* column = new QVBoxLayout(chart_);
    column->setContentsMargins(10, 30, 10, 44);
    column->setSpacing(4);
    auto tool = [&](const QString& words, const QString& tip, auto act) {
        auto* made = new QToolButton(chart_);
        made->setText(words);
        made->setToolTip(tip);
        made->setAccessibleName(tip); // the text is a symbol
        made->setFixedSize(32, 30);
        made->setCursor(Qt::ArrowCursor);
        made->setStyleSheet("padding: 0; font-size: 15px;");
        made->setFocusPolicy(Qt::TabFocus); // a click leaves the keys to the chart
        connect(made, &QToolButton::clicked, this, act);
        column->addWidget(made);
        return made;
    };
    auto of = [&](const QString& words, QAction* switched) {
        auto* made = tool(words, switched->toolTip(), [switched] { switched->toggle(); });
        made->setCheckable(true);
        made->setChecked(switched->isChecked());
        connect(made, &QToolButton::clicked, this, [made, switched] { made->setChecked(switched->isChecked()); });
        connect(switched, &QAction::toggled, made, &QToolButton::setChecked);
    };
    tool("+", tr("Nearer (+)"), [this] { chart_->zoom(1.5); });
    tool("−", tr("Farther (−)"), [this] { chart_->zoom(1 / 1.5); });
    tool("⌂", tr("Boat and waypoints (Home)"), [this] { chart_->fit(); });
    of("◎", follow_);
    of("✎", edit_);
    of("↔", measure_);
    column->addStretch(1);
}

} // namespace atirma::console
