#include "console_window.hpp"

#include "alarm_sound.hpp"
#include "boat_panel.hpp"
#include "chart_view.hpp"
#include "choice_box.hpp"
#include "command_button.hpp"
#include "fleet_list.hpp"
#include "helm_bar.hpp"
#include "instruments.hpp"
#include "links_panel.hpp"
#include "lists.hpp"
#include "mission_panel.hpp"
#include "route_gpx.hpp"
#include "theme.hpp"

#include <components/gui_client/track_store.hpp>

#include <ise/core/time_text.hpp>

#include <QApplication>
#include <QDir>
#include <QFile>
#include <QFileDialog>
#include <QFileInfo>
#include <QHBoxLayout>
#include <QLabel>
#include <QMenuBar>
#include <QResizeEvent>
#include <QSplitter>
#include <QStatusBar>
#include <QTabWidget>
#include <QTimer>

#include <initializer_list>
#include <utility>

namespace atirma::console {

namespace {

std::vector<std::string> names_of_boats(const QStringList& names) {
    std::vector<std::string> made;
    for (const auto& one : names) made.push_back(one.toStdString());
    return made;
}

} // namespace

console_window::console_window(sink act, window_options options)
    : options_(std::move(options)), act_(std::move(act)), fleet_(names_of_boats(options_.boats)), desks_(fleet_.size()),
      actions_([this](action what) { return act_(shown_, std::move(what)); }, this), seen_(fleet_.seen(0)) {
    show_texts_plainly();
    settings_ = settings_file(options_.settings);
    QString trouble;
    remembered_ = settings_.load(trouble);
    options_.night = options_.night || remembered_.night.value_or(false);
    use_units(remembered_.shown);
    red_ = remembered_.red;
    use_palette();
    sound_ = new alarm_sound(options_.alarm_player, this);
    connect(sound_, &alarm_sound::failed, this, &console_window::say);
    make_middle();
    make_menus();
    connect_middle();
    menuBar()->setCornerWidget(make_head(), Qt::TopRightCorner);
    statusBar()->setSizeGripEnabled(false);
    statusBar()->setFixedHeight(22); // always there: a message moves nothing
    record_mark_ = new QLabel(this);
    statusBar()->addPermanentWidget(record_mark_);
    connect(&actions_, &operator_actions::said, this, &console_window::say);
    auto* ticking = new QTimer(this); // ages grow without packets, too
    connect(ticking, &QTimer::timeout, this, &console_window::refresh);
    ticking->start(1000);
    auto* keeping = new QTimer(this);
    connect(keeping, &QTimer::timeout, this, &console_window::keep);
    keeping->start(3000);
    recall();
    if (boat_choice_) chart_->setFocus();
    refresh();
    if (!trouble.isEmpty()) say(trouble);
}

console_window::~console_window() {
    for (const auto& port : ports_) port->on_snapshot({});
}

/// The widgets of the shown boat.
void console_window::make_middle() {
    setWindowTitle(tr("%1 console").arg(boat_name()));
    // Created in tab order: Qt 6.4 loses nested widgets if the order is set later.
    auto* choice = make_boat_choice();
    auto* strip = make_alarm_strip();
    chart_ = new chart_view(draft(), this);
    instruments_ = new instrument_panel(this);
    auto* middle = new QWidget(this);
    auto* column = new QVBoxLayout(middle);
    column->setContentsMargins(8, 6, 8, 7);
    column->setSpacing(6);
    auto* top = new QHBoxLayout;
    top->setSpacing(6);
    if (choice) top->addWidget(choice);
    top->addWidget(strip, 1);
    column->addLayout(top);
    auto* split = split_ = new QSplitter(Qt::Horizontal, middle);
    split->setHandleWidth(8);
    split->addWidget(chart_);
    split->addWidget(make_side());
    split->setStretchFactor(0, 5);
    split->setStretchFactor(1, 3);
    split->setChildrenCollapsible(false);
    split->setSizes({780, 468});
    column->addWidget(split, 1);
    helm_ = new helm_bar(actions_, this);
    column->addWidget(helm_);
    setCentralWidget(middle);
}

void console_window::connect_middle() {
    make_chart_tools();
    connect(chart_, &chart_view::edit_refused, this, &console_window::say);
    connect(chart_, &chart_view::sail_wanted, &actions_, &operator_actions::sail_there);
    connect(chart_, &chart_view::follow_changed, follow_, &QAction::setChecked);
    // Queued: the chart is replaced by the switch.
    connect(chart_, &chart_view::boat_wanted, this, &console_window::show_boat, Qt::QueuedConnection);
    connect(mission_, &mission_panel::edit_wanted, edit_, &QAction::setChecked);
}

void console_window::show_boat(std::size_t boat) {
    if (boat == shown_ || boat >= fleet_.size()) return;
    auto& left = desks_[shown_];
    left.chart_centre.reset();
    if (chart_->placed()) {
        left.chart_centre = chart_->projection().centre;
        left.metres_per_pixel = chart_->projection().metres_per_pixel;
    }
    edit_->setChecked(false);
    measure_->setChecked(false);
    auto split = split_->saveState();
    auto tab = tabs_->currentWidget()->property("tab").toString();
    auto tail = chart_->tail();
    bool by_choice = boat_choice_->hasFocus();
    auto* before = takeCentralWidget();
    before->hide();
    before->setParent(nullptr);
    before->deleteLater(); // the switch may come from one of its widgets
    shown_ = boat;
    seen_ = fleet_.seen(boat);
    actions_.begin_boat();
    make_middle();
    connect_middle();
    fit_instruments(height());
    split_->restoreState(split);
    show_tab(tab);
    chart_->set_follow(follow_->isChecked());
    chart_->set_tail(tail);
    if (const auto& now = desks_[boat]; now.chart_centre) chart_->place(*now.chart_centre, now.metres_per_pixel);
    refresh();
    QWidget* takes_keys = chart_; // arrows are for the chart, not for a switch by accident
    if (by_choice) takes_keys = boat_choice_;
    else if (tab == "fleet") takes_keys = boats_->focus();
    takes_keys->setFocus();
}

QString console_window::boat_name() const { return QString::fromStdString(fleet_.name(shown_)); }

void console_window::attach(std::vector<std::shared_ptr<operator_port>> ports) {
    for (const auto& port : ports_) port->on_snapshot({});
    ports_ = std::move(ports);
    for (const auto& port : ports_)
        port->on_snapshot([this] {
            if (news_posted_.exchange(true)) return; // one is pending, and will take the newest
            QMetaObject::invokeMethod(
                this,
                [this] {
                    news_posted_ = false;
                    take_news();
                },
                Qt::QueuedConnection);
        });
    take_news();
}

void console_window::take_news() {
    bool of_shown = false;
    for (std::size_t boat = 0; boat < ports_.size() && boat < fleet_.size(); ++boat) {
        auto latest = ports_[boat]->latest();
        if (latest == fleet_.seen(boat)) continue;
        take_snapshot(boat, std::move(latest));
        of_shown = of_shown || boat == shown_;
    }
    if (of_shown) return refresh();
    show_fleet(now());
}

utc_time console_window::now() const {
    auto clock = options_.clock ? options_.clock()
                                : std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
    return seen_->at > clock ? seen_->at : clock;
}

void console_window::show_snapshot(std::shared_ptr<const snapshot> seen, std::size_t boat) {
    take_snapshot(boat, std::move(seen));
    refresh();
}

void console_window::take_snapshot(std::size_t boat, std::shared_ptr<const snapshot> seen) {
    fleet_.take(boat, std::move(seen));
    const auto& result = fleet_.seen(boat);
    if (boat == shown_) seen_ = result;
    if (auto& desk = desks_[boat]; result->number > 0 && !desk.told) { // it runs now: pass the saved state on
        const auto& before = memory_of(remembered_, boat).acknowledged;
        desk.told = (before.empty() || act_(boat, remember_alarms{before})) &&
                    (remembered_.limits == alarm_limits() || act_(boat, set_limits{remembered_.limits}));
    }
    if (boat != recorded_) return;
    if (auto trouble = recorder_.take(*result); !trouble.isEmpty()) {
        record_->setChecked(false);
        say(trouble);
    }
}

void console_window::end_boat(std::size_t boat, const QString& why) {
    fleet_.end(boat,
               tr("The console has ended; start it again. Nothing is received or sent: %1").arg(why).toStdString());
    sound_->play(severity::critical);
    QApplication::alert(this);
    refresh();
}

/// Whether commands are possible: what cannot be sent is not offered.
void console_window::show_ended() {
    const auto& ended = fleet_.ended(shown_);
    bool runs = ended.empty();
    chart_->show_ended(text(ended));
    mission_->allow_commands(runs);
    boat_menu_->menuAction()->setEnabled(runs);
    for (QWidget* each : std::initializer_list<QWidget*>{command_, helm_, boat_}) each->setEnabled(runs);
}

void console_window::refresh() {
    auto at = now();
    actions_.know(seen_, !fleet_.ended(shown_).empty());
    command_->show_snapshot(*seen_);
    chart_->show_snapshot(seen_, at);
    instruments_->show_boat(seen_->boat, at);
    helm_->show_snapshot(*seen_, at);
    mission_->show_snapshot(seen_, at);
    links_->show_snapshot(*seen_, at);
    boat_->show_snapshot(*seen_, at);
    log_->show_snapshot(*seen_, at);
    alarms_->show_snapshot(*seen_, at);
    packets_->show_snapshot(*seen_);
    present_->show_snapshot(*seen_, at);
    show_head(at);
    show_ended();
    show_fleet(at);
}

/// The part that depends on all boats: their list, and their alarms.
void console_window::show_fleet(utc_time at) {
    if (boats_) {
        boats_->show_fleet(fleet_, shown_, at);
        std::vector<other_boat> others;
        for (std::size_t boat = 0; boat < fleet_.size(); ++boat)
            if (auto place = place_of(*fleet_.seen(boat)); place && boat != shown_)
                others.push_back({boat, QString::fromStdString(fleet_.name(boat)), fleet_.seen(boat), *place});
        chart_->show_others(std::move(others));
        for (std::size_t boat = 0; boat < fleet_.size(); ++boat) {
            auto open = count_open(*fleet_.seen(boat)).count;
            auto name = QString::fromStdString(fleet_.name(boat));
            auto words = open == 0 ? name : tr("%1 · %2").arg(name).arg(open);
            if (auto place = static_cast<int>(boat); boat_choice_->itemText(place) != words)
                boat_choice_->setItemText(place, words);
        }
        if (auto place = static_cast<int>(shown_); boat_choice_->currentIndex() != place)
            boat_choice_->setCurrentIndex(place);
    }
    show_alarm_strip();
    ring();
    write_alarm_log();
}

/// The component says when (gui_client/alarm_bell.hpp); this window is seen and heard.
void console_window::ring() {
    auto call = fleet_.next_call();
    if (!call) return;
    sound_->play(call->how);
    QApplication::alert(this); // the window asks for attention in the task bar, until it is used
    if (call->boat != shown_) say(text(fleet_.labelled(call->boat, call->text)));
}

/// Beside the settings, for good.
void console_window::write_alarm_log() {
    auto events = fleet_.take_events();
    if (options_.settings.isEmpty() || events.empty()) return;
    auto path = QFileInfo(options_.settings).absolutePath() + "/alarms.log";
    QString lines;
    for (const auto& [boat, one] : events)
        lines += QStringLiteral("%1\t%2\t%3\t%4\n")
                     .arg(text(ise::iso_8601(one.at, 3)), text(std::string(name_of(one.how))),
                          text(std::string(name_of(one.what))), text(fleet_.labelled(boat, one.text)).simplified());
    auto folder = QFileInfo(path).absolutePath();
    constexpr qint64 most = 4 << 20; // then the one before is forgotten
    if (QFileInfo(path).size() > most) {
        QFile::remove(path + ".1");
        QFile::rename(path, path + ".1");
    }
    QFile file(path);
    bool written = QDir().mkpath(folder) && file.open(QIODevice::Append) && file.write(lines.toUtf8()) >= 0;
    if (!written && !std::exchange(log_failed_, true)) say(tr("cannot write the log of alarms %1").arg(path));
}

bool console_window::show_tab(const QString& name) {
    for (int i = 0; i < tabs_->count(); ++i) {
        if (tabs_->widget(i)->property("tab").toString() != name) continue;
        tabs_->setCurrentIndex(i);
        return true;
    }
    return false;
}

void console_window::say(const QString& words) { statusBar()->showMessage(words, 6000); }

void console_window::set_night(bool on) {
    options_.night = on;
    if (on) red_ = false;
    use_palette();
    if (night_->isChecked() != on) night_->setChecked(on);
    if (red_action_->isChecked() != red_) red_action_->setChecked(red_);
    show_palette();
}

void console_window::set_red(bool on) {
    red_ = on;
    use_palette();
    if (red_action_->isChecked() != on) red_action_->setChecked(on);
    show_palette();
}

void console_window::use_palette() { use_theme(red_ ? palette::red : options_.night ? palette::night : palette::day); }

/// Redraws the parts that keep colours.
void console_window::show_palette() {
    log_->forget();
    packets_->forget();
    mission_->forget();
    refresh();
}

void console_window::resizeEvent(QResizeEvent* event) {
    QMainWindow::resizeEvent(event);
    fit_instruments(event->size().height());
}

void console_window::fit_instruments(int height) {
    bool low = height < 680; // a tablet: the instruments leave room for the lists
    instruments_->setMaximumHeight(low ? 206 : 330);
}

void console_window::export_track(bool gpx) {
    auto name = boat_name().toLower().replace(' ', '-') + text(ise::iso_8601(now()).substr(0, 10)).prepend('-') +
                (gpx ? ".gpx" : ".csv");
    auto path =
        QFileDialog::getSaveFileName(this, tr("Export the track"), name, gpx ? tr("GPX (*.gpx)") : tr("CSV (*.csv)"));
    if (path.isEmpty()) return;
    auto content = gpx ? track_to_gpx(fleet_.name(shown_), *seen_->track, seen_->mission.points, seen_->boat.rhythm)
                       : track_to_csv(*seen_->track);
    auto trouble = write_file(path, content);
    say(trouble.isEmpty() ? tr("%1 points were written to %2").arg(seen_->track->size()).arg(path) : trouble);
}

QString console_window::import_route(const QString& path) {
    QFile file(path);
    if (!file.open(QIODevice::ReadOnly)) return tr("cannot read %1: %2").arg(path, file.errorString());
    constexpr qint64 most = 4 << 20;
    if (file.size() > most) return tr("%1 has more than 4 MiB: it is not a route").arg(path);
    auto route = route_from_gpx(file.readAll());
    if (!route.trouble.isEmpty()) return tr("%1 was not imported: %2").arg(path, route.trouble);
    draft().replace(std::move(route.points));
    show_tab("mission");
    return {};
}

QString console_window::export_route(const QString& path) const {
    auto name = boat_name() + " " + text(ise::iso_8601(now()).substr(0, 10));
    return write_file(path, route_to_gpx(name, desks_[shown_].draft->points()));
}

void console_window::import_route() {
    auto path = QFileDialog::getOpenFileName(this, tr("Import a route"), {}, tr("GPX (*.gpx);;All files (*)"));
    if (path.isEmpty()) return;
    auto trouble = import_route(path);
    say(trouble.isEmpty() ? tr("%1 waypoints were read from %2: upload them").arg(draft().points().size()).arg(path)
                          : trouble);
}

void console_window::export_route() {
    auto path = QFileDialog::getSaveFileName(this, tr("Export the route"), "route.gpx", tr("GPX (*.gpx)"));
    if (path.isEmpty()) return;
    auto trouble = export_route(path);
    say(trouble.isEmpty() ? tr("%1 waypoints were written to %2").arg(draft().points().size()).arg(path) : trouble);
}

void console_window::toggle_recording(bool on) {
    if (!on) {
        if (recorder_.running())
            say(tr("%1 packets were recorded in %2").arg(recorder_.written()).arg(recorder_.path()));
        recorder_.stop();
        return refresh();
    }
    auto path =
        QFileDialog::getSaveFileName(this, tr("Record every packet"),
                                     "packets-" + text(ise::iso_8601(now()).substr(0, 10)) + ".csv", tr("CSV (*.csv)"));
    auto trouble = path.isEmpty() ? tr("Nothing is recorded") : recorder_.start(path);
    recorded_ = shown_; // and stays that boat's when another one is shown
    if (!trouble.isEmpty()) {
        say(trouble);
        record_->setChecked(false);
    }
    refresh();
}

} // namespace atirma::console
