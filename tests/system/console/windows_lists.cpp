// The lists of the console's window, its looks, and what comes from other threads.
#include "desk.hpp"

#include <apps/console/theme.hpp>

#include <QComboBox>
#include <QDoubleSpinBox>
#include <QFile>
#include <QFrame>
#include <QPlainTextEdit>
#include <QStatusBar>
#include <QStyledItemDelegate>
#include <QTemporaryDir>
#include <QToolTip>

#include <thread>

using namespace console_test;

TEST_CASE("console windows: an alarm is shown until it is acknowledged") {
    desk it;
    auto* strip = it.window->findChild<QWidget*>("alarm_strip");
    REQUIRE(strip);
    CHECK(strip->isVisible()); // always there, so that an alarm moves nothing
    CHECK(it.find<QLabel>("alarm_text").text() == "No alarms");
    CHECK_FALSE(it.find("acknowledge_first").isVisible());
    navigation n;
    n.mode = sailing_mode::automatic;
    n.in_irons = true;
    n.waypoint_count = 3;
    it.now += 2s;
    it.hear(n);
    power p;
    p.battery_percent = 14;
    it.hear(p);
    it.show();
    REQUIRE(strip->isVisible());
    CHECK(it.find<QLabel>("alarm_text").text().contains("In irons"));
    CHECK(it.find<QLabel>("alarm_text").text().contains("+ 1 more"));
    it.window->show_tab("alarms");
    it.show();
    it.picture("alarms");
    CHECK(it.find<QTableWidget>("alarm_table").rowCount() == 2);
    it.now += 1s;
    it.find("acknowledge_first").click();
    REQUIRE(it.last<acknowledge_alarm>());
    CHECK(it.last<acknowledge_alarm>()->key == "irons");
    it.state.acknowledge("irons");
    it.show();
    CHECK(it.find<QLabel>("alarm_text").text().contains("battery"));
    it.find("acknowledge_all").click();
    CHECK(it.last<acknowledge_alarm>()->key == "battery");
    it.state.acknowledge("battery");
    it.show();
    CHECK(it.find<QLabel>("alarm_text").text() == "Acknowledged alarms: 2 (F5)");
    CHECK_FALSE(it.find("acknowledge_first").isVisible());
    CHECK(it.find<QTableWidget>("alarm_table").item(0, 2)->text() == "acknowledged");
}

TEST_CASE("console windows: an alarm that comes while the button is pressed is not acknowledged unread") {
    desk it;
    power p;
    p.battery_percent = 14;
    it.hear(p);
    it.show();
    auto& button = it.find("acknowledge_first");
    button.click(); // it has just come
    CHECK(it.actions.empty());
    CHECK(it.window->statusBar()->currentMessage().contains("has just come"));
    it.now += 1s;
    it.show();
    Q_EMIT button.pressed();
    navigation n;
    n.in_irons = true;
    it.hear(n);
    it.show();
    CHECK(it.find<QLabel>("alarm_text").text().contains("In irons"));
    Q_EMIT button.clicked();
    REQUIRE(it.actions.size() == 1);
    CHECK(it.last<acknowledge_alarm>()->key == "battery");
    it.find("acknowledge_all").click(); // one action for each that is shown
    REQUIRE(it.actions.size() == 3);
    CHECK(it.last<acknowledge_alarm>()->key == "battery");
    it.actions.clear();
    // The chosen row goes: no other alarm takes its place.
    it.window->show_tab("alarms");
    auto& table = it.find<QTableWidget>("alarm_table");
    REQUIRE(table.item(0, 1)->text().contains("In irons"));
    table.setCurrentCell(0, 0);
    n.in_irons = false;
    it.now += 2s;
    it.state.acknowledge("irons");
    it.hear(n);
    it.show();
    REQUIRE(table.rowCount() == 1);
    it.find("acknowledge_one").click();
    CHECK(it.actions.empty());
    table.setCurrentCell(0, 0);
    it.find("acknowledge_one").click();
    REQUIRE(it.last<acknowledge_alarm>());
    CHECK(it.last<acknowledge_alarm>()->key == "battery");
}

TEST_CASE("console windows: the remote control is in the head, among the alarms, and in a refused command's words") {
    desk it;
    navigation n;
    n.mode = sailing_mode::automatic;
    n.remote_control = true;
    n.waypoint_count = 3;
    it.now += 2s;
    it.hear(n);
    it.state.asked(81, xbee_path, commands::tack_now(), it.now);
    auto no = status(81, telecommand_stage::acknowledged, ack_code::refused,
                     "the remote control has the helm until it is released");
    no.kind = command_kind::tack_now;
    it.state.on_status(xbee_path, no, it.now);
    it.show();
    it.picture("remote_control");
    CHECK(it.find<QLabel>("mode").text() == "Remote control");
    CHECK(it.find<QLabel>("mode").toolTip().contains("then its mode is Auto"));
    CHECK(it.find<QLabel>("alarm_text").text().contains("The remote control has the helm"));
    CHECK(it.find<QLabel>("last_command").text().contains("refused"));
    n.remote_control = false;
    it.now += 2s;
    it.hear(n);
    it.show();
    CHECK(it.find<QLabel>("mode").text() == "Auto");
}

TEST_CASE("console windows: a position of the second controller is in the head and a critical alarm with its cause") {
    desk it;
    it.now += 70s;
    talker second;
    second.boot = beacon_boot;
    it.state.on_telemetry(
        iridium_path, second.say(notice{"beacon: main power lost; own battery 97 %"}, it.now - 6s, link_id::iridium),
        it.now - 1s);
    it.state.on_telemetry(iridium_path, second.say(at(28.155, -15.452), it.now - 5s, link_id::iridium), it.now - 1s);
    it.show();
    it.window->show_tab("alarms");
    it.show();
    it.picture("beacon");
    CHECK(it.find<QLabel>("status").text().contains("BEACON · 5 s"));
    CHECK(it.find<QLabel>("mode").text() == "mode not known");
    auto alarms = it.state.view(it.now)->alarms;
    auto* alarm = find(alarms, "second_controller");
    REQUIRE(alarm);
    CHECK(alarm->how == severity::critical);
    CHECK(alarm->text.find("is the second controller's (beacon: main power lost; own battery 97 %)") !=
          std::string::npos);
    CHECK_FALSE(find(alarms, "boot"));
    it.now += 2s;
    it.hear(at(28.155, -15.452));
    it.show();
    CHECK_FALSE(it.find<QLabel>("status").text().contains("BEACON"));
    alarms = it.state.view(it.now)->alarms;
    CHECK(find(alarms, "second_controller")->over_at);
}

TEST_CASE("console windows: a parameter shows confirmed, pending and refused values") {
    desk it;
    it.window->show_tab("boat");
    it.find<QDoubleSpinBox>("wanted_forbidden_angle_upwind").setValue(48);
    it.find("set_forbidden_angle_upwind").click();
    REQUIRE(it.last<give_command>());
    auto command = it.last<give_command>()->command;
    CHECK(command == boat_command(commands::set_parameter{parameter_id::forbidden_angle_upwind, 48}));
    it.state.asked(77, xbee_path, command, it.now);
    it.show();
    CHECK(it.find<QLabel>("confirmed_forbidden_angle_upwind").text().contains("55"));
    CHECK(it.find<QLabel>("state_forbidden_angle_upwind").text().contains("pending"));
    it.picture("boat");
    it.state.on_outcome(77, command_phase::refused, std::nullopt, "not now", it.now);
    it.show();
    CHECK(it.find<QLabel>("state_forbidden_angle_upwind").text().contains("not now"));
}

TEST_CASE("console windows: the modem's power is chosen on its card") {
    desk it;
    it.window->show_tab("links");
    it.show();
    auto& power = it.find<QComboBox>("power of " + text(xbee_path));
    CHECK(power.currentIndex() == 4);
    Q_EMIT power.activated(1);
    REQUIRE(it.last<set_xbee_parameter>());
    CHECK(it.last<set_xbee_parameter>()->path == xbee_path);
    CHECK(it.last<set_xbee_parameter>()->value == 1);
    it.picture("links");
}

TEST_CASE(
    "console windows: the inspector shows fields and bytes, the log everybody's commands, the last list who is there") {
    desk it;
    it.window->show_tab("packets");
    it.show();
    auto& packets = it.find<QTableWidget>("packet_table");
    REQUIRE(packets.rowCount() > 100);
    packets.selectRow(0);
    auto details = it.find<QPlainTextEdit>("packet_details").toPlainText();
    CHECK(details.contains("rounded waypoint 1"));
    CHECK(details.contains("0000  01 08"));
    it.picture("packets");
    boat_command hold = commands::set_mode{sailing_mode::hold};
    it.state.asked(5, xbee_path, hold, it.now - 40s);
    it.state.on_status(xbee_path, status(5, telecommand_stage::acknowledged, ack_code::done, "hold"), it.now - 37s);
    it.state.on_status(xbee_path, status(6, telecommand_stage::sent, std::nullopt, "arrived at the boat's modem"),
                       it.now - 3s);
    it.window->show_tab("log");
    it.show();
    auto& log = it.find<QTableWidget>("command_table");
    REQUIRE(log.rowCount() == 2);
    CHECK(log.item(0, 3)->text() == "other\nXBee");
    CHECK(log.item(1, 1)->text() == "mode Heading\nhold");
    CHECK(log.item(1, 2)->text().contains("done"));
    CHECK(it.find<QLabel>("last_command").toolTip().contains("mode Heading: done"));
    it.picture("log");
    it.window->show_tab("who");
    it.show();
    CHECK(it.find<QLabel>("present_head").text().contains("ben"));
    CHECK(it.find<QTableWidget>("present_table").rowCount() == 5);
    it.picture("who");
}

namespace {

/// Counts the cells that are measured.
struct counting : QStyledItemDelegate {
    mutable int measured = 0;
    QSize sizeHint(const QStyleOptionViewItem& how, const QModelIndex& of) const override {
        ++measured;
        return QStyledItemDelegate::sizeHint(how, of);
    }
};

} // namespace

TEST_CASE("console windows: with hundreds of events in the log of alarms, a new one measures its own row only") {
    counting counts;
    desk it;
    it.window->show_tab("alarms");
    auto fails = [&](std::uint32_t id, const std::string& why) {
        it.state.on_outcome(id, command_phase::refused, std::nullopt, why, it.now);
        it.show();
    };
    it.find("show_alarm_log").click();
    for (std::uint32_t id = 1; id <= 300; ++id)
        it.state.on_outcome(id, command_phase::refused, std::nullopt, "not now", it.now);
    it.show();
    auto& log = it.find<QTableWidget>("alarm_log");
    REQUIRE(log.rowCount() == static_cast<int>(alarm_book::max_events));
    log.setItemDelegate(&counts);
    fails(900, "a reason that takes several lines, because it has many words in a column that is not that wide");
    REQUIRE(log.rowCount() == static_cast<int>(alarm_book::max_events));
    CHECK(log.item(0, 2)->text() == "over");
    CHECK(log.item(1, 1)->text().contains("several lines"));
    CHECK(log.item(2, 1)->text().contains("not now"));
    CHECK(log.rowHeight(1) > log.rowHeight(2));
    CHECK(counts.measured > 0);
    CHECK(counts.measured < 40);
    // While nobody sees it, nothing is measured; afterwards all rows have their heights.
    it.find("show_alarm_log").click();
    counts.measured = 0;
    fails(901, "another reason that takes several lines, because it has many words in a column that is not that wide");
    CHECK(counts.measured == 0);
    it.find("show_alarm_log").click();
    CHECK(log.item(1, 1)->text().contains("another reason"));
    CHECK(log.rowHeight(1) > log.rowHeight(4));
    log.setItemDelegate(nullptr);
}

TEST_CASE("console windows: with hundreds of telecommands in the log, a new one measures its own row only") {
    counting counts;
    desk it;
    it.window->show_tab("log");
    for (std::uint32_t id = 1; id <= 200; ++id)
        it.state.asked(id, xbee_path, commands::ping(), it.now - 300s + id * 1s);
    it.show();
    auto& log = it.find<QTableWidget>("command_table");
    log.setItemDelegate(&counts);
    it.state.asked(900, xbee_path, commands::waypoint_read_back(), it.now);
    it.state.on_outcome(7, command_phase::refused, std::nullopt, "a reason that takes a line of its own", it.now);
    it.show();
    REQUIRE(log.rowCount() == 201);
    CHECK(log.item(0, 1)->text().startsWith("read waypoints back"));
    CHECK(log.item(194, 1)->text().contains("a line of its own"));
    CHECK(log.rowHeight(194) > log.rowHeight(193));
    CHECK(counts.measured > 0);
    CHECK(counts.measured < 40);
    log.setItemDelegate(nullptr);
}

TEST_CASE("console windows: both palettes, and both sizes that it is made for") {
    for (auto size : {QSize(1280, 800), QSize(1024, 600)}) {
        desk it(true, size);
        CHECK(it.window->minimumSizeHint().width() <= 1024);
        CHECK(it.window->minimumSizeHint().height() <= 600);
        auto corner = [&] {
            return it.window->chart().grab().toImage().pixelColor(60, it.window->chart().height() / 2);
        };
        auto day = corner();
        auto name = QStringLiteral("%1x%2").arg(size.width()).arg(size.height());
        it.picture("day-" + name);
        if (size.width() > 1100) CHECK(it.window->chart().width() > size.width() / 2);
        auto ink = [&] { return it.find<QTableWidget>("mission_table").item(0, 3)->foreground().color(); };
        auto day_ink = ink();
        it.window->set_night(true);
        CHECK(corner() != day);
        CHECK(colours().dark);
        CHECK(ink() != day_ink);
        it.picture("night-" + name);
        it.window->set_night(false);
        CHECK(corner() == day);
    }
}

TEST_CASE("console windows: the chart follows the boat until it is moved by hand") {
    desk it;
    auto& chart = it.window->chart();
    REQUIRE(chart.following());
    auto before = chart.projection().centre;
    it.mouse(QEvent::MouseButtonPress, {300, 300}, Qt::LeftButton, Qt::LeftButton);
    it.mouse(QEvent::MouseMove, {340, 300}, Qt::NoButton, Qt::LeftButton);
    it.mouse(QEvent::MouseButtonRelease, {340, 300}, Qt::LeftButton, Qt::NoButton);
    CHECK_FALSE(chart.following());
    CHECK(chart.projection().centre.longitude_deg < before.longitude_deg);
    auto held = chart.projection().to_place({100, 80});
    chart.projection().zoom(3, {100, 80});
    CHECK(chart.projection().to_pixels(held).x() == Approx(100).margin(0.1));
    CHECK(chart.projection().to_pixels(held).y() == Approx(80).margin(0.1));
    chart.set_follow(true);
    auto shown =
        chart.projection().to_pixels({28.1532 + 239 * 2.2e-5, -15.4481 - 239 * 1.25e-5 + 2e-4 * std::sin(239 / 9.0)});
    CHECK(shown.x() == Approx(chart.width() / 2.0).margin(1));
}

TEST_CASE("console windows: packets are recorded each once, and a file that cannot be written is said") {
    QTemporaryDir folder;
    console_state state;
    talker boat;
    recorder it;
    CHECK_FALSE(it.start(folder.path() + "/no/such/folder.csv").isEmpty());
    CHECK_FALSE(it.running());
    REQUIRE(it.start(folder.path() + "/packets.csv").isEmpty());
    for (int i = 0; i < 3; ++i) {
        state.on_telemetry(xbee_path, boat.say(at(28.1, -15.4), t0 + i * 1s), t0 + i * 1s);
        CHECK(it.take(*state.view(t0)).isEmpty());
        CHECK(it.take(*state.view(t0)).isEmpty());
    }
    CHECK(it.written() == 3);
    for (int i = 0; i < 700; ++i) state.on_telemetry(xbee_path, boat.say(at(28.1, -15.4), t0 + 10s + i * 1s), t0 + 10s);
    it.take(*state.view(t0));
    CHECK(it.missed() == 200); // the console keeps 500
    it.stop();
    QFile file(folder.path() + "/packets.csv");
    REQUIRE(file.open(QIODevice::ReadOnly));
    auto lines = file.readAll().split('\n');
    CHECK(lines.size() == 1 + 503 + 1);
    CHECK(lines[1].contains(",xbee,7,1,0,location,0101"));
    CHECK_FALSE(write_file(folder.path() + "/no/such.gpx", "x").isEmpty());
}

TEST_CASE("console windows: snapshots of another thread are shown, and none after the window is gone") {
    desk it(false);
    auto port = std::make_shared<operator_port>();
    it.window->attach({port});
    std::thread([&] {
        for (int i = 0; i < 50; ++i) {
            it.state.on_telemetry(xbee_path, it.talk.say(at(28.15, -15.45), t0 + i * 1s), t0 + i * 1s);
            port->publish(it.state.view(t0 + i * 1s));
        }
    }).join();
    it.now = t0 + 50s;
    QApplication::processEvents();
    CHECK(it.find<value_tile>("sog").value() == "2.3");
    it.window.reset();
    port->publish(it.state.view(t0));
    QApplication::processEvents();
    CHECK(port->latest()->track->size() == 50);
}

TEST_CASE("console windows: a console whose component has ended says so for good, and offers no command") {
    desk it;
    it.window->end_boat(
        0, "'atirma/console/anna' is held by process 14274 on shore at inproc://ise-14274-9d3ac6 under epoch "
           "1795963170660425, whose lease was renewed 229 ms ago: end it, or choose another path");
    for (int i = 0; i < 2; ++i) {
        auto& strip = it.find<QFrame>("alarm_strip");
        QApplication::processEvents();
        auto& told = it.find<QLabel>("alarm_text");
        CHECK(told.text().contains("has ended; start it again"));
        CHECK(told.text().contains("is held by process 14274"));
        CHECK(told.heightForWidth(told.width()) <= told.height()); // all of it can be read
        CHECK(strip.styleSheet().contains(colours().bad_back.name()));
        CHECK_FALSE(it.find("acknowledge_first").isVisible());
        CHECK(it.find<QLabel>("status").text() == "● ended");
        for (const char* name : {"do_tack", "mode_2", "upload", "read_back", "reboot"}) {
            INFO(name);
            CHECK_FALSE(it.find(name).isEnabled());
        }
        it.now += 60s;
        it.show();
        it.picture("ended");
    }
    for (auto* each : it.window->findChildren<QAction*>())
        if (each->shortcut() == QKeySequence("Ctrl+U")) each->trigger(); // no question that would be in vain
    CHECK(it.window->statusBar()->currentMessage().contains("has ended"));
    CHECK(it.actions.empty());
}

TEST_CASE("console windows: a click that nobody takes is said") {
    desk it;
    it.takes = false;
    it.find("do_ping").click();
    CHECK(it.window->statusBar()->currentMessage().contains("Not sent"));
}

TEST_CASE("console windows: nothing that boat, proxies, nodes or operators say is taken for markup") {
    desk it;
    const std::string evil = "<evil>x</evil><img src='/etc/hostname'><b>all is well</b>";
    it.hear(notice{evil.substr(0, notice::max_text)});
    xbee_local modem;
    modem.trouble = evil;
    modem.seal.sealed = true;
    modem.seal.key = evil + "%2";
    it.state.on_xbee(xbee_path, modem, it.now);
    gprs_state carrier;
    carrier.from = "tcp://" + evil;
    carrier.trouble = evil;
    it.state.on_gprs(gprs_path, carrier, it.now);
    communication_state node;
    node.node = evil;
    node.trouble = evil;
    it.state.on_node("atirma/shore/" + evil, false, evil, nullptr, it.now);
    it.state.on_node("atirma/shore/one", true, evil, &node, it.now);
    authority_state held;
    held.holder = "atirma/console/" + evil;
    held.asked_by = {evil};
    held.epoch = 2;
    it.state.on_authority(held, it.now);
    finding_view found;
    found.where = evil;
    found.looking_for = evil;
    for (bool reached : {true, false})
        for (bool uses : {true, false}) {
            found.reached = reached;
            found.uses_names = uses;
            it.state.on_finding(found);
            it.state.on_present({{"atirma/console/" + evil, evil, evil, evil, 88, it.now - 300s, true, false},
                                 {evil, evil, evil, evil, 89, it.now - 300s, false, false}});
            it.show();
            for (const auto* label : it.window->findChildren<QLabel*>()) {
                INFO(label->objectName().toStdString() << ": " << label->text().toStdString());
                REQUIRE(label->textFormat() != Qt::AutoText);
                if (label->textFormat() != Qt::PlainText) CHECK_FALSE(label->text().contains("<evil"));
            }
        }
    bool seen = false;
    for (const auto* label : it.window->findChildren<QLabel*>()) seen = seen || label->text().contains("evil");
    CHECK(seen);
    QToolTip::showText(QPoint(5, 5), QString::fromStdString(evil), it.window.get());
    bool shown = false;
    for (auto* widget : QApplication::topLevelWidgets())
        if (auto* tip = qobject_cast<QLabel*>(widget); tip && tip->inherits("QTipLabel")) {
            shown = true;
            CHECK(tip->textFormat() == Qt::PlainText);
        }
    CHECK(shown);
    QToolTip::hideText();
}
