#include "console_window.hpp"

#include "boat_panel.hpp"
#include "boat_words.hpp"
#include "chart_view.hpp"
#include "choice_box.hpp"
#include "command_button.hpp"
#include "fleet_list.hpp"
#include "instruments.hpp"
#include "links_panel.hpp"
#include "lists.hpp"
#include "mission_panel.hpp"
#include "theme.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/track_store.hpp>
#include <components/gui_client/words.hpp>

#include <ise/core/time_text.hpp>

#include <QHBoxLayout>
#include <QLabel>
#include <QMenuBar>
#include <QPushButton>
#include <QTabBar>
#include <QTabWidget>
#include <QToolButton>

#include <algorithm>
#include <utility>

// The parts of the window: head, alarm strip, side, the chart's tools.
namespace atirma::console {
namespace {

QString pill(const QColor& ink, const QColor& back) {
    return QStringLiteral(
               "QLabel { color: %1; background: %2; border-radius: 10px; padding: 2px 10px; font-weight: 600; }")
        .arg(ink.name(), back.name());
}

constexpr int strip_height = 34;

/// So long an alarm was in sight before a click is meant for it.
constexpr auto shown_before_click = std::chrono::milliseconds(500);

/// Only a new one: Qt lays the widget out again for each.
void set_sheet(QWidget* of, const QString& sheet) {
    if (of->styleSheet() != sheet) of->setStyleSheet(sheet);
}

} // namespace

QWidget* console_window::make_head() {
    auto* head = new QWidget(this);
    auto* row = new QHBoxLayout(head);
    row->setContentsMargins(2, 3, 10, 3);
    row->setSpacing(5);
    mode_ = new QLabel(head);
    mode_->setObjectName("mode");
    status_ = new QLabel(head);
    status_->setObjectName("status");
    clock_ = new QLabel(head);
    clock_->setObjectName("clock");
    clock_->setFont(font_of(14, QFont::DemiBold));
    clock_->setToolTip(tr("Coordinated universal time"));
    // Each has one width for all of its texts, so that nothing moves when they change.
    auto widest = [](QLabel* label, const QString& longest) {
        label->setFixedWidth(QFontMetrics(font_of(smallest_text, QFont::DemiBold)).horizontalAdvance(longest) + 22);
        label->setAlignment(Qt::AlignCenter);
    };
    widest(status_, tr("● no current data · 88 min"));
    widest(mode_, tr("Heading · 88 min"));
    clock_->setFixedWidth(QFontMetrics(clock_->font()).horizontalAdvance("88:88:88 UTC") + 6);
    command_ = new command_button(actions_, head);
    for (QWidget* each : std::initializer_list<QWidget*>{status_, mode_, command_, clock_}) row->addWidget(each);
    return head;
}

void console_window::show_head(utc_time at) {
    const auto& t = colours();
    const auto& boat = seen_->boat;
    const auto& ended = fleet_.ended(shown_);
    auto state = ended.empty() ? state_of(*seen_, at) : state_of_ended();
    auto words = state.age.isEmpty() ? state.words : tr("%1 · %2").arg(state.words, state.age);
    status_->setText("● " + words);
    status_->setToolTip(ended.empty() ? words : text(ended));
    set_sheet(status_, pill(state.ink, state.back));
    bool known = boat.sailing.has_value();
    bool irons = known && boat.sailing->value.in_irons, fence = known && boat.sailing->value.at_fence;
    bool remote = known && boat.sailing->value.remote_control;
    bool stale = freshness_of(boat.sailing, value_kind::sailing, boat, at) == freshness::stale;
    mode_->setText(mode_words(*seen_, at));
    mode_->setToolTip(!known             ? tr("The mode is not known yet")
                      : boat.on_beacon() ? tr("Nothing is heard from the main controller: see the alarms")
                      : stale            ? tr("Reported %1 ago: the last mode that is known")
                                    .arg(text(age_text(age_s(at, boat.sailing->measured_at))))
                      : remote ? tr("The remote control has rudder and sail: the boat refuses what steers it until it "
                                    "is released; then its mode is %1")
                                     .arg(text(label(boat.sailing->value.mode)))
                      : fence ? tr("It turned back at its fence or the coast")
                      : boat.sailing->value.mode == sailing_mode::hold ||
                              boat.sailing->value.mode == sailing_mode::manual
                          ? tr("It loiters when the time is over")
                          : tr("The mode that the boat reports"));
    set_sheet(mode_, !known || boat.on_beacon() ? pill(t.ink3, t.field)
                     : stale                    ? pill(t.warn, t.warn_back)
                     : irons                    ? pill(t.bad, t.bad_back)
                     : fence || remote          ? pill(t.warn, t.warn_back)
                                                : pill(t.accent, t.notice_back));
    record_mark_->setVisible(recorder_.running());
    record_mark_->setText(tr("● REC %1").arg(recorder_.written()));
    set_sheet(record_mark_, pill(t.bad, t.bad_back));
    clock_->setText(text(ise::iso_8601(at).substr(11, 8)) + " UTC");
}

/// Null where there is one boat.
QWidget* console_window::make_boat_choice() {
    if (fleet_.size() == 1) return nullptr;
    boat_choice_ = new choice_box(this);
    boat_choice_->setObjectName("boat_choice");
    boat_choice_->setAccessibleName(tr("The boat that is shown"));
    boat_choice_->setToolTip(tr("The boat that is shown, and gets the commands; behind the name, its open alarms"));
    boat_choice_->setFixedSize(150, 34); // the same for all names
    for (std::size_t boat = 0; boat < fleet_.size(); ++boat)
        boat_choice_->addItem(QString::fromStdString(fleet_.name(boat)));
    boat_choice_->setCurrentIndex(static_cast<int>(shown_));
    connect(
        boat_choice_, &QComboBox::activated, this, [this](int place) { show_boat(static_cast<std::size_t>(place)); },
        Qt::QueuedConnection);
    return boat_choice_;
}

QWidget* console_window::make_alarm_strip() {
    strip_ = new QFrame(this);
    strip_->setObjectName("alarm_strip");
    auto* row = new QHBoxLayout(strip_);
    row->setContentsMargins(12, 1, 5, 1);
    strip_text_ = new QLabel(strip_);
    strip_text_->setObjectName("alarm_text");
    strip_text_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
    strip_text_->setAccessibleName(tr("Alarm"));
    strip_->setFixedHeight(strip_height); // the same with and without an alarm
    auto* more = strip_more_ = new QPushButton(tr("Show"), strip_);
    connect(more, &QPushButton::clicked, this, [this] {
        auto open = fleet_.open_alarms(shown_);
        if (!open.empty()) show_boat(open.front().boat);
        else if (auto ended = fleet_.first_ended(shown_)) show_boat(*ended);
        show_tab("alarms");
    });
    auto* acknowledge = strip_acknowledge_ = new QPushButton(tr("Acknowledge"), strip_);
    for (auto* each : {more, acknowledge}) {
        auto kept = each->sizePolicy();
        kept.setRetainSizeWhenHidden(true);
        each->setSizePolicy(kept);
        each->hide();
    }
    acknowledge->setObjectName("acknowledge_first");
    acknowledge->setToolTip(tr("Acknowledges this alarm; it stays in the list until its cause is gone"));
    connect(acknowledge, &QPushButton::pressed, this, [this] {
        bool read = std::chrono::abs(now() - in_strip_since_) >= shown_before_click;
        pressed_ = read ? in_strip_ : std::nullopt;
    });
    connect(acknowledge, &QPushButton::clicked, this, &console_window::acknowledge_first);
    row->addWidget(strip_text_, 1);
    row->addWidget(more);
    row->addWidget(acknowledge);
    return strip_;
}

/// The alarm that was read when the button was pressed: another one may have come since.
void console_window::acknowledge_first() {
    auto read = std::exchange(pressed_, std::nullopt);
    if (!read) return say(tr("Not acknowledged: this alarm has just come"));
    if (!act_(read->boat, acknowledge_alarm{read->key})) say(tr("The console is busy: try again"));
}

void console_window::show_alarm_strip() {
    const auto& t = colours();
    const auto& all = seen_->alarms;
    auto open_alarms = fleet_.open_alarms(shown_);
    auto open = open_alarms.size();
    auto open_here = count_open(*seen_).count;
    auto ended = fleet_.first_ended(shown_);
    bool shows_end = ended && (open == 0 || *ended == shown_);
    std::optional<strip_alarm> first_open;
    if (open > 0 && !shows_end) {
        const auto& [boat, first] = open_alarms.front();
        first_open = strip_alarm{boat, first.key, first.how, first.raised_at};
    }
    if (in_strip_ != first_open) {
        in_strip_ = std::move(first_open);
        in_strip_since_ = now();
    }
    strip_more_->setVisible(open > 0 || (ended && *ended != shown_));
    strip_acknowledge_->setVisible(open > 0 && !shows_end);
    auto place = tabs_->indexOf(alarms_);
    bool grave = std::ranges::any_of(all, [](const auto& a) { return !a.acknowledged && a.how == severity::critical; });
    tabs_->tabBar()->setTabTextColor(place, grave ? t.bad : open_here > 0 ? t.warn : QColor());
    tabs_->setTabToolTip(place, tr("Active alarms: %1 (F5)").arg(all.size()));
    auto strip_sheet = [](const QColor& back, const QColor& ink, int weight) {
        return QStringLiteral(
                   "QFrame#alarm_strip { background: %1; border-radius: 9px; } QLabel { color: %2; font-weight: %3; }")
            .arg(back.name(), ink.name())
            .arg(weight);
    };
    if (shows_end) {
        auto told = text(fleet_.labelled(*ended, fleet_.ended(*ended)));
        set_sheet(strip_, strip_sheet(t.bad_back, t.bad, 600));
        auto words = open > 0 ? told + tr("   + %1 more").arg(open) : told;
        strip_text_->setWordWrap(true);
        strip_text_->setText(words);
        strip_text_->setToolTip(told);
        QFontMetrics letters(font_of(smallest_text, QFont::DemiBold));
        QRect room(0, 0, std::max(100, strip_text_->width()), 10'000);
        auto lines = letters.boundingRect(room, Qt::TextWordWrap, words).height() / letters.lineSpacing();
        strip_->setFixedHeight(strip_height + (lines - 1) * letters.lineSpacing()); // it stays: all of it is shown
        return;
    }
    strip_text_->setWordWrap(false);
    strip_->setFixedHeight(strip_height);
    if (open == 0) {
        set_sheet(strip_, strip_sheet(t.page, t.ink3, 400));
        strip_text_->setText(all.empty() ? tr("No alarms") : tr("Acknowledged alarms: %1 (F5)").arg(all.size()));
        strip_text_->setToolTip({});
        return;
    }
    const auto& [boat, first] = open_alarms.front();
    auto told = text(fleet_.labelled(boat, first.text));
    auto back = first.how == severity::critical  ? t.bad_back
                : first.how == severity::warning ? t.warn_back
                                                 : t.notice_back;
    set_sheet(strip_, strip_sheet(back, t.of(first.how), 600));
    auto words = QStringLiteral("%1  %2").arg(text(ise::iso_8601(first.raised_at).substr(11, 8)), told);
    if (first.over_at) words += tr("  (over)");
    if (open > 1) words += tr("   + %1 more").arg(open - 1);
    if (ended) words += QStringLiteral("   + ") + text(fleet_.labelled(*ended, fleet_.ended(*ended)));
    strip_text_->setText(words);
    strip_text_->setToolTip(told);
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
    mission_ = new mission_panel(draft(), actions_, tabs_);
    links_ = new links_panel(actions_, tabs_);
    boat_ = new boat_panel(actions_, tabs_);
    log_ = new command_list([this](std::uint32_t id) { actions_.act(call_back_command{id}); }, tabs_);
    alarms_ = new alarm_list([this](const std::string& key) { return actions_.act(acknowledge_alarm{key}); }, tabs_);
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
    if (fleet_.size() > 1) {
        boats_ = new fleet_list([this](std::size_t boat) { show_boat(boat); }, tabs_);
        boats_->setProperty("tab", "fleet");
        tabs_->setTabToolTip(tabs_->addTab(boats_, tr("Fleet")), tr("All boats, and switching between them (F8)"));
    }
    connect(tabs_, &QTabWidget::currentChanged, this, [this] { refresh(); });
    column->addWidget(tabs_, 7);
    side->setMinimumWidth(440);
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
