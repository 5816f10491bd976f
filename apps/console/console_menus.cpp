#include "console_window.hpp"

#include "chart_view.hpp"
#include "lists.hpp"
#include "mission_panel.hpp"
#include "telecommand_dialog.hpp"
#include "theme.hpp"

#include <components/gui_client/words.hpp>

#include <QAction>
#include <QActionGroup>
#include <QMenuBar>
#include <QMessageBox>
#include <QTabWidget>

namespace atirma::console {

QAction* console_window::add(QMenu* to, const QString& words, const QKeySequence& key, std::function<void()> act) {
    auto* made = to->addAction(words);
    made->setShortcut(key);
    made->setShortcutContext(Qt::WindowShortcut);
    made->setAutoRepeat(false); // a key that is held sends a command once
    connect(made, &QAction::triggered, this, [act = std::move(act)] { act(); });
    return made;
}

void console_window::make_menus() {
    auto toggle = [this](QMenu* to, const QString& words, const QKeySequence& key, bool on, auto act) {
        auto* made = to->addAction(words);
        made->setShortcut(key);
        made->setAutoRepeat(false);
        made->setCheckable(true);
        made->setChecked(on);
        made->setToolTip(
            QStringLiteral("%1 (%2)").arg(QString(words).remove('&'), key.toString(QKeySequence::NativeText)));
        connect(made, &QAction::toggled, this, act);
        return made;
    };
    auto* file = menuBar()->addMenu(tr("&File"));
    add(file, tr("Export track as &GPX…"), QKeySequence("Ctrl+Shift+G"), [this] { export_track(true); });
    add(file, tr("Export track as &CSV…"), QKeySequence("Ctrl+Shift+C"), [this] { export_track(false); });
    record_ =
        toggle(file, tr("&Record packets…"), QKeySequence("Ctrl+R"), false, [this](bool on) { toggle_recording(on); });
    add(file, tr("Forget the track drawn here"), {}, [this] { actions_.act(forget_track()); });
    file->addSeparator();
    add(file, tr("&Quit"), QKeySequence::Quit, [this] { close(); });

    auto* view = menuBar()->addMenu(tr("&View"));
    night_ =
        toggle(view, tr("&Night colours"), QKeySequence("Ctrl+N"), options_.night, [this](bool on) { set_night(on); });
    red_action_ =
        toggle(view, tr("Re&d night colours"), QKeySequence("Ctrl+Shift+N"), red_, [this](bool on) { set_red(on); });
    follow_ =
        toggle(view, tr("&Follow the boat"), QKeySequence("F"), true, [this](bool on) { chart_->set_follow(on); });
    measure_ = toggle(view, tr("&Measure"), QKeySequence("M"), false, [this](bool on) {
        if (on) edit_->setChecked(false);
        chart_->set_measure(on);
    });
    add(view, tr("&Boat and waypoints"), QKeySequence("Home"), [this] { chart_->fit(); });
    if (fleet_.size() > 1) {
        auto* all = add(view, tr("&All boats"), QKeySequence("Shift+Home"), [this] { chart_->fit_fleet(); });
        all->setObjectName("all_boats");
    }
    add(view, tr("Nearer"), QKeySequence("+"), [this] { chart_->zoom(1.5); })->setAutoRepeat(true);
    add(view, tr("Farther"), QKeySequence("-"), [this] { chart_->zoom(1 / 1.5); })->setAutoRepeat(true);
    auto* tail = view->addMenu(tr("&Track shown"));
    auto* lengths = new QActionGroup(this);
    for (auto [words, seconds] : {std::pair{tr("All"), 0.0},
                                  {tr("12 hours"), 43200.0},
                                  {tr("2 hours"), 7200.0},
                                  {tr("30 minutes"), 1800.0},
                                  {tr("10 minutes"), 600.0}}) {
        auto* one = tail->addAction(words);
        one->setCheckable(true);
        one->setChecked(seconds == remembered_.tail_s);
        lengths->addAction(one);
        connect(one, &QAction::triggered, this, [this, s = seconds] { chart_->set_tail(s); });
    }
    make_units(view);
    view->addSeparator();
    for (int i = 0; i < tabs_->count(); ++i)
        add(view, tabs_->tabText(i), QKeySequence(Qt::Key_F1 + i), [this, i] { tabs_->setCurrentIndex(i); });
    add(view, tr("Full screen"), QKeySequence("F11"), [this] { isFullScreen() ? showNormal() : showFullScreen(); });

    auto* boat = boat_menu_ = menuBar()->addMenu(tr("&Boat"));
    int number = 1;
    for (auto mode : {sailing_mode::automatic, sailing_mode::hold, sailing_mode::station_keep,
                      sailing_mode::return_home, sailing_mode::manual})
        add(boat, text(label(mode)), QKeySequence(QStringLiteral("Ctrl+%1").arg(number++)),
            [this, mode] { actions_.set_mode(mode); });
    boat->addSeparator();
    add(boat, tr("&Tack now"), QKeySequence("Ctrl+T"), [this] { actions_.give(commands::tack_now()); });
    add(boat, tr("&Gybe now"), QKeySequence("Ctrl+G"), [this] { actions_.give(commands::gybe_now()); });
    add(boat, tr("&Ping"), QKeySequence("Ctrl+P"), [this] { actions_.give(commands::ping()); });
    add(boat, tr("Request &status"), QKeySequence("Ctrl+I"), [this] { actions_.give(commands::request_status()); });
    boat->addSeparator();
    add(boat, tr("Emergency &beacon on…"), {}, [this] { actions_.give(commands::emergency_beacon{true}); });
    add(boat, tr("Emergency beacon o&ff…"), {}, [this] { actions_.give(commands::emergency_beacon{false}); });
    add(boat, tr("&Reboot…"), {}, [this] { actions_.give(commands::reboot()); });
    auto* validity = boat->addMenu(tr("&Validity of commands"));
    auto* times = new QActionGroup(this);
    for (auto [words, seconds] : {std::pair{tr("Usual time"), 0},
                                  {tr("30 s"), 30},
                                  {tr("2 min"), 120},
                                  {tr("10 min"), 600},
                                  {tr("1 h"), 3600},
                                  {tr("6 h"), 21600}}) {
        auto* one = validity->addAction(words);
        one->setCheckable(true);
        one->setChecked(seconds == 0);
        times->addAction(one);
        connect(one, &QAction::triggered, this, [this, s = seconds] {
            actions_.choose_validity(s == 0 ? std::nullopt : std::optional(static_cast<float>(s)));
        });
    }
    auto* all = boat->addMenu(tr("A&ll telecommands"));
    all->setToolTipsVisible(true);
    for_each_telecommand([&]<class C>(const C& preset) {
        auto words = text(describe(C::traits.kind));
        constexpr bool has_arguments = ise::field_count < C >> 0;
        auto* made = add(all, has_arguments ? words + "…" : words, {}, [this, command = boat_command(preset)] {
            telecommand_dialog dialog(command, actions_.validity_text(C::traits.kind, std::nullopt), this);
            if (!has_arguments || dialog.exec() == QDialog::Accepted) actions_.give(dialog.command(), dialog.valid_s());
        });
        made->setObjectName("telecommand_" + text(std::string(name_of(C::traits.kind))));
        made->setToolTip(text(std::string(C::traits.help)));
    });

    auto* mission = menuBar()->addMenu(tr("&Mission"));
    edit_ = toggle(mission, tr("&Edit on the chart"), QKeySequence("Ctrl+E"), false, [this](bool on) {
        if (on) measure_->setChecked(false);
        chart_->set_edit(on);
        mission_->set_editing(on);
        if (on) show_tab("mission");
    });
    add(mission, tr("Ne&w list"), QKeySequence("Ctrl+Shift+E"), [this] { mission_->begin_new(); });
    add(mission, tr("&Undo"), QKeySequence::Undo, [this] { draft().undo(); });
    add(mission, tr("&Upload…"), QKeySequence("Ctrl+U"),
        [this] { actions_.upload(draft().points(), seen_->mission.points); });
    add(mission, tr("Read &back"), QKeySequence("Ctrl+B"), [this] { actions_.give(commands::waypoint_read_back()); });
    add(mission, tr("As on the b&oat"), {}, [this] { draft().take_over(seen_->mission.points); });

    mission->addSeparator();
    add(mission, tr("&Import route (GPX)…"), QKeySequence("Ctrl+O"), [this] { import_route(); });
    add(mission, tr("E&xport route (GPX)…"), QKeySequence("Ctrl+Shift+S"), [this] { export_route(); });

    auto* help = menuBar()->addMenu(tr("&Alarms"));
    add(help, tr("Acknowledge &all alarms"), QKeySequence("Ctrl+K"), [this] { alarms_->acknowledge_all(); });
    add(help, tr("Alarm &limits…"), QKeySequence("Ctrl+L"), [this] { edit_limits(); });
    add(help, tr("&Keys and mouse"), QKeySequence("Shift+F1"), [this] { show_keys(); });
}

// Generated from the menus, so that it is complete.
void console_window::show_keys() {
    auto row = [](const QString& key, const QString& does) {
        return QStringLiteral("<tr><td><b>%1</b></td><td>%2</td></tr>")
            .arg(key.toHtmlEscaped().replace(' ', "&nbsp;"), does.toHtmlEscaped().replace(' ', "&nbsp;"));
    };
    auto table = [](const QString& title, const QString& rows) {
        return QStringLiteral("<p><b>%1</b></p><table cellpadding=1>%2</table>").arg(title.toHtmlEscaped(), rows);
    };
    auto keys_of = [&](const QMenu* menu) {
        QString rows;
        for (const auto* one : menu->actions())
            if (!one->shortcut().isEmpty())
                rows += row(one->shortcut().toString(QKeySequence::NativeText),
                            QString(one->text()).remove('&').remove(QChar(0x2026)));
        return table(QString(menu->title()).remove('&'), rows);
    };
    auto more =
        table(tr("Chart"), row(tr("Arrows, drag"), tr("move")) + row(tr("Wheel"), tr("nearer, farther")) +
                               row(tr("Right click"), tr("sail here, measure")) + row(tr("Menu key"), tr("the same")) +
                               row(tr("Editing"), tr("click, drag, Del")) + row(tr("Tab"), tr("to the next control")));
    QList<QMenu*> menus;
    for (const auto* entry : menuBar()->actions())
        if (entry->menu()) menus << entry->menu();
    QString words = QStringLiteral("<table><tr>");
    for (const auto& column : {QList<int>{0, 3, 4}, {1}, {2, -1}}) { // three columns of one height: they fit a tablet
        words += QStringLiteral("<td>");
        for (int n : column)
            if (n < menus.size()) words += n < 0 ? more : keys_of(menus[n]);
        words += QStringLiteral("</td><td width=16></td>");
    }
    QMessageBox box(this);
    box.setWindowTitle(tr("Keys and mouse"));
    box.setTextFormat(Qt::RichText);
    box.setText(words + "</tr></table>");
    box.exec();
}

void console_window::make_units(QMenu* to) {
    auto* below = to->addMenu(tr("&Units"));
    auto choices = [&](auto field, auto... each) {
        auto* group = new QActionGroup(this);
        auto one = [&](const QString& words, auto value) {
            auto* made = below->addAction(words);
            made->setCheckable(true);
            made->setChecked(remembered_.shown.*field == value);
            group->addAction(made);
            connect(made, &QAction::triggered, this, [this, field, value] {
                auto chosen = shown_units();
                chosen.*field = value;
                set_units(chosen);
            });
        };
        (one(each.first, each.second), ...);
        below->addSeparator();
    };
    choices(&units::speed, std::pair(tr("Speed in knots"), speed_unit::knots),
            std::pair(tr("Speed in m/s"), speed_unit::metres), std::pair(tr("Speed in km/h"), speed_unit::kilometres));
    choices(&units::distance, std::pair(tr("Distance in nautical miles"), distance_unit::nautical),
            std::pair(tr("Distance in kilometres"), distance_unit::metric));
    choices(&units::place, std::pair(tr("Places in degrees and minutes"), place_format::minutes),
            std::pair(tr("Places in decimal degrees"), place_format::decimal));
}

} // namespace atirma::console
