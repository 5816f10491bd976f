// The windows of the console, driven as an operator does, without a display. With CONSOLE_PICTURES=FOLDER they leave
// pictures.
#include <apps/console/chart_view.hpp>
#include <apps/console/console_window.hpp>
#include <apps/console/instruments.hpp>
#include <apps/console/theme.hpp>
#include <components/gui_client/console_state.hpp>
#include <unit/gui_client/packets.hpp>

#include <support/catch.hpp>

#include <QApplication>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QFile>
#include <QLabel>
#include <QMessageBox>
#include <QMouseEvent>
#include <QPlainTextEdit>
#include <QPushButton>
#include <QStatusBar>
#include <QTableWidget>
#include <QTemporaryDir>
#include <QTimer>

#include <cstdlib>
#include <thread>

using namespace console_test;

namespace {

void start_qt() {
    static int count = 1;
    static char name[] = "system_console_windows";
    static char* words[] = {name, nullptr};
    static QApplication* app = [] {
        qputenv("QT_QPA_PLATFORM", "offscreen");
        return new QApplication(count, words); // lives as long as the program
    }();
    (void)app;
}

const std::vector<waypoint> course{{28.1530, -15.4480}, {28.1600, -15.4520}, {28.1545, -15.4580}};

/// A console whose actions are kept, with a boat that has told everything.
struct desk {
    explicit desk(bool with_boat = true, QSize size = {1280, 800}) {
        start_qt();
        window_options look;
        look.clock = [this] { return now; };
        window = std::make_unique<console_window>([this](action what) {
            actions.push_back(std::move(what));
            return takes;
        }, look);
        window->resize(size);
        window->show();
        if (with_boat) sail();
        show();
    }
    void sail() {
        state.on_link(xbee_path, true, "", t0);
        state.takes_commands(xbee_path);
        state.on_link(gprs_path, true, "", t0);
        state.takes_commands(gprs_path);
        for (int i = 0; i < 240; ++i) { // along the first leg, the last part told over GPRS
            auto place = at(28.1532 + i * 2.2e-5, -15.4481 - i * 1.25e-5 + 2e-4 * std::sin(i / 9.0));
            place.course_over_ground_deg = 333;
            auto link = i > 160 && i < 228 ? link_id::gprs : link_id::xbee;
            state.on_telemetry(link == link_id::gprs ? gprs_path : xbee_path, talk.say(place, t0 + i * 4s, link),
                               t0 + i * 4s + 400ms);
        }
        now = t0 + 239 * 4s + 1s;
        navigation n;
        n.mode = sailing_mode::automatic;
        n.heading_deg = 341;
        n.heel_deg = -11;
        n.rudder_commanded_deg = 6;
        n.rudder_measured_deg = 4;
        n.sail_commanded_deg = 34;
        n.sail_measured_deg = -31;
        n.waypoint_index = 1;
        n.waypoint_count = 3;
        n.distance_to_waypoint_m = 172;
        n.bearing_to_waypoint_deg = 335;
        n.cross_track_error_m = -3;
        hear(n);
        wind w;
        w.true_direction_deg = 45;
        w.true_speed_mps = 6.2f;
        w.apparent_angle_deg = 55;
        w.apparent_speed_mps = 7;
        hear(w);
        power p;
        p.battery_v = 12.7f;
        p.battery_a = 0.4f;
        p.battery_percent = 83;
        p.temperature_c = 31;
        p.uptime_s = 18240;
        hear(p);
        configuration c;
        c.forbidden_angle_upwind_deg = 55;
        c.forbidden_angle_downwind_deg = 15;
        c.telemetry_period_s = {2, 10, 0};
        hear(c);
        waypoints list;
        list.revision = 3;
        list.count = 3;
        list.active = 1;
        list.entries = course;
        hear(list);
        link_status there;
        there.up = true;
        there.rssi_dbm = -78;
        there.queued = 2;
        there.sent = 1240;
        there.failed = 11;
        hear(there);
        hear(notice{"rounded waypoint 1"});
        xbee_local modem;
        modem.port_open = modem.modem_ready = true;
        modem.rssi_dbm = std::int16_t{-74};
        modem.temperature_c = std::int16_t{41};
        modem.duty_cycle_percent = std::uint8_t{23};
        modem.failed_deliveries = std::uint16_t{3};
        modem.failed_acknowledgements = std::uint16_t{17};
        modem.power_level = std::uint8_t{4};
        modem.supply_mv = std::uint16_t{3290};
        state.on_xbee(xbee_path, modem, now);
        finding_view found;
        found.reached = true;
        found.where = "tcp://127.0.0.1:7400";
        found.looking_for = "telemetry below atirma";
        state.on_finding(found);
        state.on_present({{"atirma/boat", "boat_simulator", "ready", "shore", 411, now - 3600s, false, false},
                          {"atirma/console/anna", "gui_client", "ready", "shore", 532, now - 900s, true, true},
                          {"atirma/console/ben", "gui_client", "ready", "van", 88, now - 300s, true, false},
                          {gprs_path, "gprs_proxy", "ready", "shore", 415, now - 3600s, false, false},
                          {xbee_path, "xbee_proxy", "ready", "shore", 413, now - 3600s, false, false}});
    }
    void hear(const telemetry_body& body) { state.on_telemetry(xbee_path, talk.say(body, now - 600ms), now - 100ms); }
    void show() {
        state.on_time(now);
        window->show_snapshot(state.view(now));
        QApplication::processEvents();
    }
    template <class Widget = QPushButton>
    Widget& find(const QString& name) {
        auto* found = window->findChild<Widget*>(name);
        REQUIRE(found);
        return *found;
    }
    template <class Action>
    const Action* last() const {
        return actions.empty() ? nullptr : std::get_if<Action>(&actions.back());
    }
    /// Presses that button of the question that comes next.
    void answer_next(const QString& with) {
        QTimer::singleShot(0, window.get(), [this, with] {
            auto* box = qobject_cast<QMessageBox*>(QApplication::activeModalWidget());
            REQUIRE(box);
            asked = box->text() + "\n" + box->informativeText();
            if (with.isEmpty()) return box->defaultButton()->click(); // what Enter does
            for (auto* button : box->buttons())
                if (button->text() == with) return button->click();
            box->reject();
        });
    }
    void mouse(QEvent::Type type, QPointF at, Qt::MouseButton button, Qt::MouseButtons held) {
        auto& chart = window->chart();
        QMouseEvent event(type, at, chart.mapToGlobal(at), button, held, Qt::NoModifier);
        QApplication::sendEvent(&chart, &event);
    }
    void click(QPointF at, Qt::MouseButton button = Qt::LeftButton) {
        mouse(QEvent::MouseButtonPress, at, button, button);
        mouse(QEvent::MouseButtonRelease, at, button, Qt::NoButton);
    }
    void picture(const QString& name) {
        if (const char* folder = std::getenv("CONSOLE_PICTURES")) {
            QApplication::processEvents();
            REQUIRE(window->grab().save(QString(folder) + "/" + name + ".png"));
        }
    }

    console_state state;
    talker talk;
    utc_time now = t0;
    std::vector<action> actions;
    bool takes = true;
    QString asked;
    std::unique_ptr<console_window> window;
};

} // namespace

TEST_CASE("console windows: without a boat they say what they look for, and ask nobody anything") {
    desk it(false);
    CHECK(it.find<QLabel>("status").text().contains("no boat yet"));
    CHECK(it.find<value_tile>("sog").how() == freshness::none);
    CHECK(it.find<value_tile>("sog").value().isEmpty());
    CHECK(it.find<QLabel>("mission_state").text().contains("not known"));
    CHECK(it.actions.empty());
    finding_view found;
    found.where = "tcp://127.0.0.1:7400";
    found.looking_for = "telemetry below atirma";
    it.state.on_finding(found);
    it.show();
    it.picture("empty");
}

TEST_CASE("console windows: every value shows how old it is, and the head says when nothing is current") {
    desk it;
    auto& speed = it.find<value_tile>("sog");
    CHECK(speed.value() == "2.3"); // 1.2 m/s in knots
    CHECK(speed.how() == freshness::fresh);
    CHECK(it.find<QLabel>("status").text().contains("live"));
    it.now += 15s;
    it.show();
    CHECK(speed.how() == freshness::ageing);
    it.now += 60s;
    it.show();
    CHECK(speed.how() == freshness::stale);
    CHECK(it.find<QLabel>("status").text().contains("no current data"));
    CHECK(speed.value() == "2.3"); // the last that is known stays
    it.picture("stale");
}

TEST_CASE("console windows: a mode lights up when the boat says so, not when it is pressed") {
    desk it;
    auto& automatic = it.find("mode_2");
    auto& hold = it.find("mode_1");
    CHECK(automatic.isChecked());
    hold.click();
    REQUIRE(it.last<give_command>());
    CHECK(it.last<give_command>()->command.kind == command_kind::set_mode);
    CHECK(it.last<give_command>()->command.mode == sailing_mode::hold);
    CHECK(it.last<give_command>()->via.empty());
    CHECK_FALSE(hold.isChecked());
    navigation n;
    n.mode = sailing_mode::hold;
    it.now += 2s;
    it.hear(n);
    it.show();
    CHECK(hold.isChecked());
    CHECK_FALSE(automatic.isChecked());
}

TEST_CASE("console windows: commands go over the link that was chosen") {
    desk it;
    auto& links = it.find<QComboBox>("link_choice");
    int gprs = links.findText("GPRS");
    REQUIRE(gprs > 0);
    links.setCurrentIndex(gprs);
    Q_EMIT links.activated(gprs);
    it.find("do_tack").click();
    REQUIRE(it.last<give_command>());
    CHECK(it.last<give_command>()->command.kind == command_kind::tack_now);
    CHECK(it.last<give_command>()->via == gprs_path);
}

TEST_CASE("console windows: what is dangerous asks first, and Enter does no harm") {
    desk it;
    for (const char* name : {"reboot", "beacon", "mode_0"}) {
        INFO(name);
        it.answer_next("");
        it.find(name).click();
        CHECK(it.actions.empty());
        CHECK(it.asked.contains("Tell the boat"));
        it.answer_next("Send it");
        it.find(name).click();
        CHECK(it.last<give_command>());
        it.actions.clear();
    }
}

TEST_CASE(
    "console windows: waypoints are edited by mouse, taken back, and uploaded when that is confirmed") {
    desk it;
    auto& draft = it.window->draft();
    auto& chart = it.window->chart();
    REQUIRE(draft.points() == course);
    CHECK_FALSE(draft.edited());
    it.find("edit").click();
    REQUIRE(chart.editing());
    QPointF free(chart.width() * 0.8, chart.height() * 0.3);
    it.click(free);
    REQUIRE(draft.points().size() == 4);
    CHECK(draft.edited());
    auto placed = chart.projection().to_place(free);
    CHECK(draft.points()[3].latitude_deg == Approx(placed.latitude_deg).margin(1e-9));
    auto to = free + QPointF(-60, 40);
    it.mouse(QEvent::MouseButtonPress, free, Qt::LeftButton, Qt::LeftButton);
    it.mouse(QEvent::MouseMove, to, Qt::NoButton, Qt::LeftButton);
    it.mouse(QEvent::MouseButtonRelease, to, Qt::LeftButton, Qt::NoButton);
    CHECK(draft.points().size() == 4);
    CHECK(chart.projection().to_pixels(draft.points()[3]).x() == Approx(to.x()).margin(0.01));
    it.show();
    auto& table = it.find<QTableWidget>("mission_table");
    REQUIRE(table.rowCount() == 4);
    CHECK(table.item(0, 3)->text() == "same");
    CHECK(table.item(3, 3)->text() == "only here");
    CHECK(it.find<QLabel>("mission_state").text().contains("the boat has 3, here are 4"));
    it.picture("mission");
    // A snapshot never overwrites what is edited.
    it.show();
    CHECK(draft.points().size() == 4);
    it.answer_next("Cancel");
    it.find("upload").click();
    CHECK(it.actions.empty());
    it.answer_next("Send it");
    it.find("upload").click();
    REQUIRE(it.last<upload_mission>());
    CHECK(it.last<upload_mission>()->points == draft.points());
    it.click(chart.projection().to_pixels(draft.points()[0]), Qt::RightButton);
    CHECK(draft.points().size() == 3);
    it.find("undo").click();
    CHECK(draft.points().size() == 4);
    it.find("take_over").click();
    CHECK(draft.points() == course);
    CHECK_FALSE(draft.edited());
}

TEST_CASE("console windows: a waypoint is moved in the table, and nonsense is not taken") {
    desk it;
    auto& table = it.find<QTableWidget>("mission_table");
    table.item(1, 0)->setText("28.1611");
    QApplication::processEvents();
    CHECK(it.window->draft().points()[1].latitude_deg == Approx(28.1611));
    CHECK(table.item(1, 3)->text().contains("away"));
    table.item(1, 0)->setText("north");
    QApplication::processEvents();
    CHECK(it.window->draft().points()[1].latitude_deg == Approx(28.1611));
    CHECK(table.item(1, 0)->text() == "28.161100");
    table.item(1, 1)->setText("-200");
    QApplication::processEvents();
    CHECK(it.window->draft().points()[1].longitude_deg == Approx(-15.4520));
}

TEST_CASE("console windows: an upload shows where it is and how it ended, then the list is the boat's again") {
    desk it;
    auto longer = course;
    longer.push_back({28.1550, -15.4500});
    it.window->draft().insert(3, longer[3]);
    upload_view upload;
    upload.phase = upload_phase::sending;
    upload.total = 4;
    upload.done = 2;
    upload.text = "sends waypoint 3 of 4";
    it.state.on_upload(upload);
    it.show();
    CHECK(it.find("cancel_upload").isVisible());
    CHECK_FALSE(it.find("upload").isEnabled());
    CHECK(it.find<QLabel>("upload_state").text().contains("3 of 4"));
    it.find("cancel_upload").click();
    CHECK(it.last<cancel_upload>());
    waypoints list;
    list.revision = 9;
    list.count = 4;
    list.entries = longer;
    it.now += 2s;
    it.hear(list);
    upload.phase = upload_phase::verified;
    it.state.on_upload(upload);
    it.show();
    CHECK_FALSE(it.find("cancel_upload").isVisible());
    CHECK(it.find<QLabel>("upload_state").text().contains("verified"));
    CHECK_FALSE(it.window->draft().edited());
    CHECK(it.window->draft().points() == longer);
}

TEST_CASE("console windows: an alarm is shown until it is acknowledged") {
    desk it;
    auto* strip = it.window->findChild<QWidget*>("alarm_strip");
    REQUIRE(strip);
    CHECK_FALSE(strip->isVisible());
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
    it.find("acknowledge_first").click();
    REQUIRE(it.last<acknowledge_alarm>());
    CHECK(it.last<acknowledge_alarm>()->key == "irons");
    it.state.acknowledge("irons");
    it.show();
    CHECK(it.find<QLabel>("alarm_text").text().contains("battery"));
    it.find("acknowledge_all").click();
    CHECK(it.last<acknowledge_alarm>()->key.empty());
    it.state.acknowledge("");
    it.show();
    CHECK_FALSE(strip->isVisible());
    CHECK(it.find<QTableWidget>("alarm_table").item(0, 2)->text() == "acknowledged");
}

TEST_CASE("console windows: a parameter shows what is confirmed, what is under way and what was refused") {
    desk it;
    it.window->show_tab("boat");
    it.find<QDoubleSpinBox>("wanted_forbidden_angle_upwind").setValue(48);
    it.find("set_forbidden_angle_upwind").click();
    REQUIRE(it.last<give_command>());
    auto command = it.last<give_command>()->command;
    CHECK(command.parameter == parameter_id::forbidden_angle_upwind);
    CHECK(command.value == 48.0f);
    it.state.asked(77, xbee_path, command, it.now);
    it.show();
    CHECK(it.find<QLabel>("confirmed_forbidden_angle_upwind").text().contains("55"));
    CHECK(it.find<QLabel>("state_forbidden_angle_upwind").text().contains("under way"));
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
    boat_command hold;
    hold.kind = command_kind::set_mode;
    hold.mode = sailing_mode::hold;
    it.state.asked(5, xbee_path, hold, it.now - 40s);
    it.state.on_status(xbee_path, status(5, telecommand_stage::acknowledged, ack_code::done, "hold"), it.now - 37s);
    it.state.on_status(xbee_path, status(6, telecommand_stage::sent, std::nullopt, "arrived at the boat's modem"),
                       it.now - 3s);
    it.window->show_tab("log");
    it.show();
    auto& log = it.find<QTableWidget>("command_table");
    REQUIRE(log.rowCount() == 2);
    CHECK(log.item(0, 3)->text() == "other");
    CHECK(log.item(1, 1)->text() == "mode Hold");
    CHECK(log.item(1, 2)->text().contains("done"));
    CHECK(it.find<QLabel>("last_command").toolTip().contains("mode Hold: done"));
    it.picture("log");
    it.window->show_tab("who");
    it.show();
    CHECK(it.find<QLabel>("present_head").text().contains("ben"));
    CHECK(it.find<QTableWidget>("present_table").rowCount() == 5);
    it.picture("who");
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
    it.window->attach(port);
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

TEST_CASE("console windows: a click that nobody takes is said") {
    desk it;
    it.takes = false;
    it.find("do_ping").click();
    CHECK(it.window->statusBar()->currentMessage().contains("Nothing was given"));
}
