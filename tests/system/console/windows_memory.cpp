// What the console keeps over a start, the limits of its alarms, its units, and the authority over the boat.
#include "desk.hpp"

#include <apps/console/command_button.hpp>
#include <apps/console/limits_dialog.hpp>
#include <apps/console/settings.hpp>
#include <apps/console/telecommand_dialog.hpp>
#include <apps/console/theme.hpp>

#include <QAction>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QFile>
#include <QLabel>
#include <QLineEdit>
#include <QMenu>
#include <QPushButton>
#include <QStatusBar>
#include <QTabWidget>
#include <QTemporaryDir>

using namespace console_test;

namespace {

QAction* entry(QMenu& menu, const QString& words) {
    Q_EMIT menu.aboutToShow();
    for (auto* one : menu.actions())
        if (one->text().contains(words)) return one;
    return nullptr;
}

QAction* menu_entry(desk& it, const QString& words) {
    for (auto* one : it.window->findChildren<QAction*>())
        if (one->text().remove('&').contains(words)) return one;
    return nullptr;
}

void in_command(desk& it, const std::string& holder, std::vector<std::string> asked_by = {}) {
    authority_state held;
    held.holder = holder;
    held.epoch = it.state.authority().state.epoch + 2;
    held.since = it.now;
    held.how = holder.empty() ? "released" : "taken by " + holder;
    held.asked_by = std::move(asked_by);
    it.state.set_self("atirma/console/anna");
    it.state.on_authority(held, it.now);
    it.show();
}

} // namespace

TEST_CASE("console windows: every telecommand is in the menu, and its arguments are asked for") {
    desk it;
    auto entry_of = [&](command_kind kind) {
        return it.window->findChild<QAction*>("telecommand_" + text(std::string(name_of(kind))));
    };
    for (const auto& one : names_of<command_kind>()) {
        CAPTURE(one.name);
        REQUIRE(entry_of(one.value));
        CHECK_FALSE(entry_of(one.value)->toolTip().isEmpty());
    }
    entry_of(command_kind::gybe_now)->trigger();
    REQUIRE(it.last<give_command>());
    CHECK(it.last<give_command>()->command == boat_command(commands::gybe_now()));
    QTimer::singleShot(0, it.window.get(), [&] {
        auto* dialog = qobject_cast<telecommand_dialog*>(QApplication::activeModalWidget());
        REQUIRE(dialog);
        auto* send = dialog->findChild<QPushButton*>("telecommand_accept");
        dialog->findChild<QComboBox*>("argument_link")->setCurrentIndex(2);
        dialog->findChild<QDoubleSpinBox*>("argument_period_s")->setValue(-1);
        CHECK_FALSE(send->isEnabled());
        CHECK(dialog->findChild<QLabel*>("telecommand_trouble")->text().contains("0.5 to 86400 s"));
        dialog->findChild<QDoubleSpinBox*>("argument_period_s")->setValue(600);
        CHECK(send->isEnabled());
        dialog->accept();
    });
    entry_of(command_kind::set_telemetry_period)->trigger();
    CHECK(it.last<give_command>()->command == boat_command(commands::set_telemetry_period{link_id::iridium, 600}));
    QTimer::singleShot(0, it.window.get(), [&] {
        auto* dialog = qobject_cast<telecommand_dialog*>(QApplication::activeModalWidget());
        REQUIRE(dialog);
        dialog->findChild<QDoubleSpinBox*>("argument_index")->setValue(3); // as people count
        dialog->findChild<QDoubleSpinBox*>("argument_point_latitude")->setValue(28.16);
        dialog->findChild<QDoubleSpinBox*>("argument_point_longitude")->setValue(-15.45);
        dialog->accept();
    });
    entry_of(command_kind::waypoint_insert)->trigger();
    CHECK(it.last<give_command>()->command == boat_command(commands::waypoint_insert{2, {28.16, -15.45}}));
    QTimer::singleShot(0, it.window.get(), [&] {
        auto* dialog = qobject_cast<telecommand_dialog*>(QApplication::activeModalWidget());
        REQUIRE(dialog);
        auto* checksum = dialog->findChild<QDoubleSpinBox*>("argument_checksum");
        REQUIRE(checksum);
        checksum->setValue(4294967295.0);
        CHECK(checksum->value() == 4294967295.0);
        CHECK(dialog->findChild<QPushButton*>("telecommand_accept")->isEnabled());
        dialog->reject();
    });
    entry_of(command_kind::mission_switch)->trigger();
    CHECK(it.last<give_command>()->command == boat_command(commands::waypoint_insert{2, {28.16, -15.45}}));
}

TEST_CASE("console windows: a raw telecommand takes text or hexadecimal, says what is wrong, and must be confirmed") {
    desk it;
    auto* entry = it.window->findChild<QAction*>("telecommand_raw");
    REQUIRE(entry);
    auto dialog_with = [&](const QString& payload, bool good) {
        QTimer::singleShot(0, it.window.get(), [&it, payload, good] {
            auto* dialog = qobject_cast<telecommand_dialog*>(QApplication::activeModalWidget());
            REQUIRE(dialog);
            auto* send = dialog->findChild<QPushButton*>("telecommand_accept");
            auto* trouble = dialog->findChild<QLabel*>("telecommand_trouble");
            CHECK_FALSE(send->isEnabled()); // it is empty
            dialog->findChild<QLineEdit*>("argument_payload")->setText(payload);
            CHECK(send->isEnabled() == good);
            if (!good) CHECK(trouble->text() == "payload: 'G' is no hexadecimal digit");
            if (const char* to = std::getenv("CONSOLE_PICTURES"); to && good)
                dialog->grab().save(QString(to) + "/raw_telecommand.png");
            if (!good) return dialog->reject();
            it.answer_next({}); // Enter sends nothing
            dialog->accept();
        });
        entry->trigger();
    };
    auto before = it.actions.size();
    dialog_with("hex:0G", false);
    CHECK(it.actions.size() == before);
    dialog_with("hex:0A 1B", true);
    CHECK(it.actions.size() == before);
    CHECK(it.asked.contains("Tell the boat: raw hex:0A 1B?"));
    CHECK(it.asked.contains("neither shore nor boat checks what they do"));
}

TEST_CASE("console windows: palette, units, limits, chart, list and acknowledged alarms are kept over a start") {
    QTemporaryDir folder;
    auto file = folder.filePath("made/here/console.ini");
    {
        desk it(true, {1100, 700}, file);
        it.window->set_night(true);
        REQUIRE(menu_entry(it, "Speed in m/s"));
        menu_entry(it, "Speed in m/s")->trigger();
        CHECK(it.find<value_tile>("sog").value() == "1.2");
        menu_entry(it, "decimal degrees")->trigger();
        it.window->show_tab("links");
        it.window->draft().insert(3, {28.1550, -15.4500});
        it.window->chart().set_follow(false);
        it.window->chart().place({28.16, -15.46}, 5);
        power low;
        low.battery_percent = 12;
        it.hear(low);
        it.state.on_time(it.now);
        it.state.acknowledge("battery");
        it.show();
        QTimer::singleShot(0, it.window.get(), [&] {
            auto* dialog = qobject_cast<limits_dialog*>(QApplication::activeModalWidget());
            REQUIRE(dialog);
            dialog->findChild<QDoubleSpinBox*>("limit_off_track")->setValue(150);
            dialog->accept();
        });
        menu_entry(it, "Alarm limits")->trigger();
        REQUIRE(it.last<set_limits>());
        CHECK(it.last<set_limits>()->limits.off_track_m == 150);
        it.window->close();
    }
    use_units({});
    desk it(true, {1100, 700}, file);
    CHECK(colours().dark);
    CHECK(it.find<value_tile>("sog").value() == "1.2");
    CHECK(shown_units().place == place_format::decimal);
    CHECK(it.window->draft().edited());
    CHECK(it.window->draft().points().size() == 4); // what the boat says does not take its place
    CHECK_FALSE(it.window->chart().following());
    CHECK(it.window->chart().projection().metres_per_pixel == Approx(5));
    CHECK(it.find<QTabWidget>("tabs").currentWidget()->property("tab").toString() == "links");
    REQUIRE(it.actions.size() == 2); // the component learns what was kept
    auto* before = std::get_if<remember_alarms>(&it.actions[0]);
    REQUIRE(before);
    REQUIRE(before->before.size() == 1);
    CHECK(before->before[0].key == "battery");
    auto* limits = std::get_if<set_limits>(&it.actions[1]);
    REQUIRE(limits);
    CHECK(limits->limits.off_track_m == 150);
    it.window->set_night(false);
    use_units({});
}

TEST_CASE("console windows: settings that are damaged, hostile or cannot be written do no harm, and are said") {
    QTemporaryDir folder;
    auto file = folder.filePath("console.ini");
    auto write = [&](const QByteArray& content) {
        QFile to(file);
        REQUIRE(to.open(QIODevice::WriteOnly | QIODevice::Truncate));
        to.write(content);
    };
    QString trouble;
    write("\x00\xff not a file of ours [[[\n");
    CHECK(settings_file(file).load(trouble) == console_memory());
    CHECK(trouble.contains("console.ini"));
    trouble.clear();
    write("[General]\nversion=1\n[alarms]\noff_track_m=nan\nno_data_s=-5\nbattery_low_percent=30\nacknowledged="
          "critical battery, nonsense\n"
          "[chart]\nmetres_per_pixel=1e300\ncentre=91 0\n[units]\nspeed=furlongs\n"
          "[mission]\nedited=true\nwaypoints=28.1 -15.4, 200 0, "
          "here\n[window]\ngeometry=junk\nsplit=junk\ntab=kitchen\n");
    auto kept = settings_file(file).load(trouble);
    CHECK(trouble.isEmpty());
    CHECK(kept.limits.off_track_m == alarm_limits().off_track_m);
    CHECK(kept.limits.no_data_s == alarm_limits().no_data_s);
    CHECK(kept.limits.battery_low_percent == 30);
    CHECK(kept.shown == units());
    CHECK(kept.draft.size() == 1);
    CHECK_FALSE(kept.chart_centre);
    CHECK(kept.acknowledged.size() == 1);
    { desk it(true, {1280, 800}, file); } // and the window opens all the same
    write("");
    desk it(true, {1280, 800}, folder.filePath("console.ini/no/folder.ini"));
    CHECK(settings_file(folder.filePath("console.ini/no/folder.ini"))
              .save(console_memory())
              .contains("cannot save the settings"));
}

TEST_CASE("console windows: an alarm that was acknowledged before the start does not call again, unless it is graver") {
    console_state state;
    talker boat;
    state.remember({{"battery", severity::warning}, {"irons", severity::critical}}, t0 + 10min);
    auto battery = [&](int percent, utc_time now) {
        power p;
        p.battery_percent = static_cast<std::uint8_t>(percent);
        state.on_telemetry(xbee_path, boat.say(p, now), now);
        state.on_time(now);
        return *find(state.view(now)->alarms, "battery");
    };
    CHECK(battery(15, t0).acknowledged);
    CHECK_FALSE(battery(5, t0 + 1min).acknowledged); // critical now
    navigation n;
    n.in_irons = true;
    state.on_telemetry(xbee_path, boat.say(n, t0 + 20min), t0 + 20min); // too late to be the same
    state.on_time(t0 + 20min);
    CHECK_FALSE(find(state.view(t0 + 20min)->alarms, "irons")->acknowledged);
}

TEST_CASE("console windows: limits that contradict each other cannot be accepted") {
    start_qt();
    limits_dialog dialog{alarm_limits()};
    auto* accept = dialog.findChild<QPushButton*>("limits_accept");
    auto* critical = dialog.findChild<QDoubleSpinBox*>("limit_battery_critical");
    REQUIRE(accept);
    REQUIRE(critical);
    CHECK(accept->isEnabled());
    critical->setValue(60);
    CHECK_FALSE(accept->isEnabled());
    critical->setValue(15);
    CHECK(accept->isEnabled());
    CHECK(dialog.limits().battery_critical_percent == 15);
}

TEST_CASE("console windows: the holder of the authority is shown, and a command offers to take it first") {
    desk it;
    auto& button = it.find<command_button>("command");
    CHECK_FALSE(button.isVisible()); // no communication node, no authority
    it.find("do_tack").click();
    REQUIRE(it.last<give_command>());
    CHECK(it.last<give_command>()->authority == taking::no);
    it.actions.clear();

    in_command(it, "");
    CHECK(button.isVisible());
    CHECK(button.text() == "no authority held");
    it.answer_next("Cancel");
    it.find("do_tack").click();
    CHECK(it.actions.empty());
    CHECK(it.asked.contains("Nobody has the authority over the boat"));
    it.find("do_ping").click(); // needs none
    REQUIRE(it.last<give_command>());
    it.answer_next("Take it and send");
    it.find("do_tack").click();
    REQUIRE(it.last<give_command>());
    CHECK(it.last<give_command>()->authority == taking::if_free);
    it.picture("nobody-commands");

    in_command(it, "atirma/console/ben");
    CHECK(button.text() == "ben has authority");
    it.actions.clear();
    it.answer_next("");
    it.find("do_tack").click(); // Enter does no harm
    CHECK(it.actions.empty());
    it.answer_next("Ask ben");
    it.find("do_tack").click();
    REQUIRE(it.last<change_authority>());
    CHECK(it.last<change_authority>()->request.action == authority_action::ask);
    auto* force = entry(*button.menu(), "Take it from");
    REQUIRE(force);
    it.answer_next("Hold to send");
    force->trigger();
    CHECK(it.last<change_authority>()->request.confirmed);

    in_command(it, "atirma/console/anna", {"atirma/console/ben"});
    CHECK(button.text() == "ben asks for it");
    auto* hand = entry(*button.menu(), "Hand over to ben");
    REQUIRE(hand);
    hand->trigger();
    CHECK(it.last<change_authority>()->request.action == authority_action::hand_over);
    CHECK(it.last<change_authority>()->request.to == "atirma/console/ben");
    it.find("do_tack").click();
    CHECK(it.last<give_command>()->authority == taking::no);
    it.picture("you-command");
    in_command(it, "atirma/console/anna");
    it.window->show_tab("who");
    it.show();
    CHECK(it.find<QTableWidget>("present_table").item(1, 0)->text().contains("authority"));

    it.state.on_node("atirma/shore/one", true, "", nullptr, it.now);
    it.show();
    CHECK(button.text() == "you have authority");
    it.state.on_node("atirma/shore/one", false, "it is not reached", nullptr, it.now);
    it.show();
    CHECK(button.toolTip().contains("authority not known"));
    CHECK(button.toolTip().contains("the last holder that one reported: anna"));
    CHECK(button.styleSheet().contains(colours().warn.name()));
    it.state.on_node("atirma/shore/one", true, "", nullptr, it.now);

    in_command(it, "atirma/console/ben");
    CHECK(it.find<QLabel>("alarm_text").text().contains("lost the authority")); // taken by somebody else
}
