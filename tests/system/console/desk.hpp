// A console's window without a display, and what an operator does with it. With CONSOLE_PICTURES=FOLDER it leaves
// pictures.
#pragma once
#include <apps/console/chart_view.hpp>
#include <apps/console/console_window.hpp>
#include <apps/console/instruments.hpp>
#include <components/gui_client/console_state.hpp>
#include <unit/gui_client/packets.hpp>

#include <support/catch.hpp>

#include <QApplication>
#include <QLabel>
#include <QMessageBox>
#include <QMouseEvent>
#include <QPushButton>
#include <QTableWidget>
#include <QTimer>

#include <cstdlib>

namespace console_test {

inline void start_qt() {
    static int count = 1;
    static char name[] = "system_console_windows";
    static char* words[] = {name, nullptr};
    static QApplication* app = [] {
        qputenv("QT_QPA_PLATFORM", "offscreen");
        auto* made = new QApplication(count, words); // lives as long as the program
        QApplication::setDoubleClickInterval(0);     // tests click faster than people do
        return made;
    }();
    (void)app;
}

inline const std::vector<waypoint> course{{28.1530, -15.4480}, {28.1600, -15.4520}, {28.1545, -15.4580}};

/// A console whose actions are kept, with a boat that has told everything.
struct desk {
    explicit desk(bool with_boat = true, QSize size = {1280, 800}, const QString& settings = {},
                  const QString& player = "none", const QStringList& boats = {"A-Tirma"}) {
        start_qt();
        window_options look;
        look.settings = settings;
        look.alarm_player = player;
        look.boats = boats;
        look.clock = [this] { return now; };
        window = std::make_unique<console_window>(
            [this](std::size_t boat, action what) {
                actions.push_back(std::move(what));
                acted_on.push_back(boat);
                return takes;
            },
            look);
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
    std::vector<std::size_t> acted_on; ///< the boat of each action
    bool takes = true;
    QString asked;
    std::unique_ptr<console_window> window;
};

} // namespace console_test
