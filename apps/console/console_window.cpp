#include "console_window.hpp"

#include "boat_panel.hpp"
#include "chart_view.hpp"
#include "command_button.hpp"
#include "helm_bar.hpp"
#include "instruments.hpp"
#include "links_panel.hpp"
#include "lists.hpp"
#include "mission_panel.hpp"
#include "theme.hpp"

#include <components/gui_client/track_store.hpp>

#include <QFileDialog>
#include <QHBoxLayout>
#include <QLabel>
#include <QMenuBar>
#include <QResizeEvent>
#include <QSplitter>
#include <QStatusBar>
#include <QTabWidget>
#include <QTimer>

namespace atirma::console {

console_window::console_window(operator_actions::sink act, window_options options)
    : options_(std::move(options)), actions_(std::move(act), this) {
    show_texts_plainly();
    setWindowTitle(tr("%1 console").arg(options_.boat_name));
    settings_ = settings_file(options_.settings);
    QString trouble;
    remembered_ = settings_.load(trouble);
    options_.night = options_.night || remembered_.night.value_or(false);
    use_units(remembered_.shown);
    use_theme(options_.night);
    // Created in tab order: Qt 6.4 loses nested widgets if the order is set later.
    auto* strip = make_alarm_strip();
    chart_ = new chart_view(draft_, this);
    instruments_ = new instrument_panel(this);
    auto* middle = new QWidget(this);
    auto* column = new QVBoxLayout(middle);
    column->setContentsMargins(8, 6, 8, 7);
    column->setSpacing(6);
    column->addWidget(strip);
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
    make_menus();
    make_chart_tools();
    menuBar()->setCornerWidget(make_head(), Qt::TopRightCorner);
    statusBar()->setSizeGripEnabled(false);
    statusBar()->hide();
    connect(statusBar(), &QStatusBar::messageChanged, this,
            [this](const QString& words) { statusBar()->setVisible(!words.isEmpty()); });
    connect(&actions_, &operator_actions::said, this, &console_window::say);
    connect(chart_, &chart_view::edit_refused, this, &console_window::say);
    connect(chart_, &chart_view::sail_wanted, &actions_, &operator_actions::sail_there);
    connect(chart_, &chart_view::follow_changed, follow_, &QAction::setChecked);
    connect(mission_, &mission_panel::edit_wanted, edit_, &QAction::setChecked);
    auto* ticking = new QTimer(this); // ages grow without packets, too
    connect(ticking, &QTimer::timeout, this, &console_window::refresh);
    ticking->start(1000);
    auto* keeping = new QTimer(this);
    connect(keeping, &QTimer::timeout, this, &console_window::keep);
    keeping->start(3000);
    recall();
    show_snapshot(operator_port().latest());
    if (!trouble.isEmpty()) say(trouble);
}

console_window::~console_window() {
    if (port_) port_->on_snapshot({});
}

void console_window::attach(std::shared_ptr<operator_port> port) {
    if (port_) port_->on_snapshot({});
    port_ = std::move(port);
    port_->on_snapshot([this] {
        if (news_posted_.exchange(true)) return; // one is pending, and will take the newest
        QMetaObject::invokeMethod(
            this,
            [this] {
                news_posted_ = false;
                show_snapshot(port_->latest());
            },
            Qt::QueuedConnection);
    });
    show_snapshot(port_->latest());
}

utc_time console_window::now() const {
    auto clock = options_.clock ? options_.clock()
                                : std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
    return seen_ && seen_->at > clock ? seen_->at : clock;
}

void console_window::show_snapshot(std::shared_ptr<const snapshot> seen) {
    seen_ = std::move(seen);
    if (seen_->number > 0 && !told_component_) // it runs now: pass the saved state on
        told_component_ =
            (remembered_.acknowledged.empty() || actions_.act(remember_alarms{remembered_.acknowledged})) &&
            (remembered_.limits == alarm_limits() || actions_.act(set_limits{remembered_.limits}));
    if (auto trouble = recorder_.take(*seen_); !trouble.isEmpty()) {
        record_->setChecked(false);
        say(trouble);
    }
    refresh();
}

void console_window::refresh() {
    if (!seen_) return;
    auto at = now();
    actions_.know(seen_->authority);
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
    show_alarm_strip();
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
    use_theme(on);
    if (night_->isChecked() != on) night_->setChecked(on);
    log_->forget();
    packets_->forget();
    mission_->forget();
    refresh();
}

void console_window::resizeEvent(QResizeEvent* event) {
    QMainWindow::resizeEvent(event);
    bool low = event->size().height() < 680; // a tablet: the instruments leave room for the lists
    instruments_->setMaximumHeight(low ? 232 : 330);
}

void console_window::export_track(bool gpx) {
    auto name = options_.boat_name.toLower().replace(' ', '-') + text(iso_time(now()).substr(0, 10)).prepend('-') +
                (gpx ? ".gpx" : ".csv");
    auto path =
        QFileDialog::getSaveFileName(this, tr("Export the track"), name, gpx ? tr("GPX (*.gpx)") : tr("CSV (*.csv)"));
    if (path.isEmpty()) return;
    auto content = gpx ? track_to_gpx(options_.boat_name.toStdString(), *seen_->track, seen_->mission.points)
                       : track_to_csv(*seen_->track);
    auto trouble = write_file(path, content);
    say(trouble.isEmpty() ? tr("%1 points were written to %2").arg(seen_->track->size()).arg(path) : trouble);
}

void console_window::toggle_recording(bool on) {
    if (!on) {
        if (recorder_.running())
            say(tr("%1 packets were recorded in %2").arg(recorder_.written()).arg(recorder_.path()));
        recorder_.stop();
        return refresh();
    }
    auto path = QFileDialog::getSaveFileName(
        this, tr("Record every packet"), "packets-" + text(iso_time(now()).substr(0, 10)) + ".csv", tr("CSV (*.csv)"));
    auto trouble = path.isEmpty() ? tr("Nothing is recorded") : recorder_.start(path);
    if (!trouble.isEmpty()) {
        say(trouble);
        record_->setChecked(false);
    }
    refresh();
}

} // namespace atirma::console
