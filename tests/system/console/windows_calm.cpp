// What makes the console worth leaving open: nothing moves, all can be read, and nothing dangerous goes by a slip.
#include "desk.hpp"

#include <apps/console/alarm_sound.hpp>
#include <apps/console/hold_button.hpp>
#include <apps/console/limits_dialog.hpp>
#include <apps/console/number_box.hpp>
#include <apps/console/route_gpx.hpp>
#include <apps/console/theme.hpp>

#include <QAbstractButton>
#include <QComboBox>
#include <QElapsedTimer>
#include <QFile>
#include <QHeaderView>
#include <QMenuBar>
#include <QTabBar>
#include <QTabWidget>
#include <QTemporaryDir>

#include <map>

using namespace console_test;

namespace {

/// Whether a part of it is seen: a scroll area may hide it.
bool in_sight(const QWidget& of) {
    if (!of.isVisible()) return false;
    auto rect = QRect(of.mapTo(of.window(), QPoint()), of.size());
    for (auto* above = of.parentWidget(); above; above = above->parentWidget()) {
        rect &= QRect(above->mapTo(of.window(), QPoint()), above->size());
        if (above->isWindow()) break;
    }
    return !rect.isEmpty();
}

/// Where everything is that can be clicked, in the window.
std::map<QString, QRect> places(QWidget& window) {
    std::map<QString, QRect> made;
    for (auto* each : window.findChildren<QWidget*>()) {
        bool clicked = qobject_cast<QAbstractButton*>(each) || qobject_cast<QComboBox*>(each) ||
                       qobject_cast<number_box*>(each) || qobject_cast<QTableWidget*>(each);
        if (each->window() != &window || each->objectName().startsWith("qt_scroll")) continue;
        auto name =
            QStringLiteral("%1 %2 %3").arg(each->metaObject()->className(), each->objectName()).arg(quintptr(each));
        if (auto* bar = qobject_cast<QTabBar*>(each); bar && bar->isVisible())
            for (int i = 0; i < bar->count(); ++i)
                made[name + QString::number(i)] = bar->tabRect(i).translated(bar->mapTo(&window, QPoint()));
        else if (clicked && in_sight(*each)) made[name] = QRect(each->mapTo(&window, QPoint()), each->size());
    }
    return made;
}

void wait_for(const std::function<bool()>& done) {
    QElapsedTimer since;
    since.start();
    while (!done() && since.elapsed() < 10'000) QApplication::processEvents(QEventLoop::AllEvents, 20);
}

void press(QWidget& on, QEvent::Type type) {
    QMouseEvent event(type, QPointF(5, 5), on.mapToGlobal(QPointF(5, 5)), Qt::LeftButton,
                      type == QEvent::MouseButtonPress ? Qt::LeftButton : Qt::NoButton, Qt::NoModifier);
    QApplication::sendEvent(&on, &event);
}

// A player of sounds that runs these commands in the folder, with the sound's file as $1.
QString script_in(const QTemporaryDir& folder, const QByteArray& commands) {
    QFile script(folder.filePath("player"));
    REQUIRE(script.open(QIODevice::WriteOnly));
    script.write("#!/bin/sh\ncd \"" + folder.path().toUtf8() + "\"\n" + commands);
    script.close();
    script.setPermissions(QFile::ReadOwner | QFile::WriteOwner | QFile::ExeOwner);
    return script.fileName();
}

// What it has appended to the file "played" there.
QByteArray played_in(const QTemporaryDir& folder) {
    QFile file(folder.filePath("played"));
    return file.open(QIODevice::ReadOnly) ? file.readAll() : QByteArray();
}

} // namespace

TEST_CASE("console windows: no message, alarm, mode, age or upload moves anything by a pixel") {
    for (auto size : {QSize(1280, 800), QSize(1024, 600)})
        for (const char* tab : {"mission", "links", "boat"}) {
            if (size.width() < 1280 && tab == std::string("links"))
                continue; // a modem's power moves with its age there
            desk it(true, size);
            it.window->show_tab(tab);
            it.show();
            auto before = places(*it.window);
            REQUIRE(before.size() > 20);
            auto unmoved = [&](const char* after) {
                it.show();
                auto now = places(*it.window);
                for (const auto& [name, rect] : before) {
                    INFO(tab << ", " << size.width() << ": " << name.toStdString() << " after " << after);
                    REQUIRE(now.count(name) == 1);
                    auto is = now[name];
                    CHECK(is == rect);
                }
            };
            it.window->say("a message that is quite long, as those about files in deep folders are");
            unmoved("a message");
            navigation n;
            n.mode = sailing_mode::hold;
            n.in_irons = true;
            it.now += 2s;
            it.hear(n);
            power p;
            p.battery_percent = 7;
            it.hear(p);
            unmoved("alarms");
            it.state.acknowledge("", it.now);
            unmoved("their acknowledgement");
            it.now += 400s;
            unmoved("an age of minutes");
            n.in_irons = false;
            it.hear(n);
            unmoved("another mode");
            upload_view upload;
            upload.phase = upload_phase::sending;
            upload.total = 3;
            upload.text = "sends waypoint 1 of 3, which is a text that is too long for one line of the panel";
            it.state.on_upload(upload);
            unmoved("an upload");
            upload.phase = upload_phase::failed;
            it.state.on_upload(upload);
            unmoved("its end");
            it.state.asked(9, xbee_path, commands::set_parameter{parameter_id::time_to_next_tack, 20}, it.now);
            unmoved("a parameter that is pending");
            it.state.on_outcome(9, command_phase::refused, std::nullopt, "refused for a reason that is very long",
                                it.now);
            unmoved("a refusal");
        }
}

TEST_CASE("console windows: at 1024 x 600 every button can be read, and no text is smaller than 14 pixels") {
    desk it(true, {1024, 600});
    auto* menus = it.window->menuBar();
    for (auto* each : menus->actions()) {
        INFO("menu " << each->text().toStdString());
        CHECK(menus->rect().contains(menus->actionGeometry(each)));
        CHECK(menus->actionGeometry(each).width() > 10);
    }
    auto& tabs = it.find<QTabWidget>("tabs");
    for (int place = 0; place < tabs.count(); ++place) {
        tabs.setCurrentIndex(place);
        it.show();
        auto name = tabs.widget(place)->property("tab").toString();
        it.picture("calm-" + name);
        for (auto* each : it.window->findChildren<QWidget*>()) {
            if (!each->isVisible() || each->window() != it.window.get()) continue;
            INFO(name.toStdString() << ": " << each->metaObject()->className() << " "
                                    << each->objectName().toStdString());
            CHECK(QFontInfo(each->font()).pixelSize() >= 14);
            auto* button = qobject_cast<QAbstractButton*>(each);
            if (!button || button->text().isEmpty() || !in_sight(*each)) continue;
            INFO(button->text().toStdString() << " in " << each->width() << " of " << each->sizeHint().width());
            CHECK(QFontMetrics(each->font()).horizontalAdvance(button->text().remove('&')) + 8 <= each->width());
            CHECK(each->height() >= QFontMetrics(each->font()).height() + 2);
            QRect at(each->mapTo(it.window.get(), QPoint()), each->size());
            CHECK(it.window->rect().contains(at));
        }
    }
}

TEST_CASE("console windows: what is dangerous is held for a second, and a short press and Enter do nothing") {
    start_qt();
    hold_button button("Hold to send");
    int sent = 0, short_ones = 0;
    QObject::connect(&button, &QPushButton::clicked, [&] { ++sent; });
    QObject::connect(&button, &hold_button::too_short, [&] { ++short_ones; });
    button.show();
    press(button, QEvent::MouseButtonPress);
    QApplication::processEvents();
    press(button, QEvent::MouseButtonRelease);
    CHECK(short_ones == 1);
    QKeyEvent enter(QEvent::KeyPress, Qt::Key_Return, Qt::NoModifier);
    QApplication::sendEvent(&button, &enter);
    CHECK(sent == 0);
    press(button, QEvent::MouseButtonPress);
    wait_for([&] { return sent > 0; });
    CHECK(sent == 1);
    press(button, QEvent::MouseButtonRelease);
    QKeyEvent space(QEvent::KeyPress, Qt::Key_Space, Qt::NoModifier);
    QApplication::sendEvent(&button, &space);
    wait_for([&] { return sent > 1; });
    CHECK(sent == 2);
    CHECK(short_ones == 1);
}

TEST_CASE("console windows: a mission of three points takes five actions") {
    desk it;
    int actions = 0;
    it.find("new_list").click();
    ++actions;
    auto& chart = it.window->chart();
    REQUIRE(chart.editing());
    for (auto at : {waypoint{28.1530, -15.4480}, waypoint{28.1600, -15.4520}, waypoint{28.1545, -15.4580}}) {
        it.click(chart.projection().to_pixels(at));
        ++actions;
    }
    REQUIRE(it.window->draft().points().size() == 3);
    auto& upload = it.find("upload");
    press(upload, QEvent::MouseButtonPress);
    wait_for([&] { return it.last<upload_mission>() != nullptr; });
    ++actions;
    REQUIRE(it.last<upload_mission>());
    CHECK(it.last<upload_mission>()->points.size() == 3);
    CHECK(actions <= 5);
}

TEST_CASE("console windows: a leg over land goes only with an override that names it") {
    desk it;
    it.window->draft().replace({{28.1530, -15.4480}, {28.1600, -15.3900}});
    it.answer_next("Cancel");
    it.find("upload").click();
    CHECK(it.actions.empty());
    CHECK(it.asked.contains("Land or fence"));
    it.answer_next("Hold to send");
    it.find("upload").click();
    REQUIRE(it.last<upload_mission>());
    CHECK(it.last<upload_mission>()->over_limits);
    it.window->draft().replace({{28.1600, -15.4520}});
    it.find("upload").click(); // in the water: held, and nothing else is asked
    CHECK_FALSE(it.last<upload_mission>()->over_limits);
}

TEST_CASE("console windows: a number out of range stays as it was typed, and says so") {
    desk it;
    it.window->show_tab("boat");
    it.show();
    auto& box = it.find<number_box>("wanted_forbidden_angle_upwind");
    auto& state = it.find<QLabel>("state_forbidden_angle_upwind");
    auto& set = it.find("set_forbidden_angle_upwind");
    box.setValue(12);
    it.show();
    CHECK(box.value() == 12);
    CHECK(box.property("state") == "bad");
    CHECK(state.isVisible());
    CHECK(state.text().contains("30 to 85, not 12"));
    CHECK_FALSE(set.isEnabled());
    it.picture("boat-out-of-range");
    box.setValue(40);
    it.show();
    CHECK(box.property("state") == "changed");
    CHECK(state.text().contains("changed here, not sent"));
    CHECK(set.isEnabled());
    set.click();
    REQUIRE(it.last<give_command>());
    it.show();
    CHECK(box.property("state").toString().isEmpty());

    limits_dialog dialog{alarm_limits()};
    auto* duty = dialog.findChild<number_box*>("limit_duty");
    REQUIRE(duty);
    duty->setValue(250);
    CHECK(duty->value() == 250);
    CHECK_FALSE(dialog.findChild<QPushButton*>("limits_accept")->isEnabled());
    CHECK(dialog.findChild<QLabel*>("limits_trouble")->text().contains("1 to 100 %, not 250"));
    duty->setValue(80);
    CHECK(dialog.findChild<QPushButton*>("limits_accept")->isEnabled());
    CHECK(duty->property("state") == "changed");
}

TEST_CASE("console windows: values that do not apply show a dash") {
    desk it;
    CHECK_FALSE(it.find<value_tile>("xte").value().isEmpty());
    navigation n;
    n.mode = sailing_mode::hold;
    n.waypoint_count = 3;
    n.distance_to_waypoint_m = 50;
    it.now += 2s;
    it.hear(n);
    auto rests = at(28.155, -15.452);
    rests.speed_over_ground_mps = 0;
    it.hear(rests);
    it.show();
    for (const char* name : {"xte", "dtw", "btw", "eta", "cog"}) {
        INFO(name);
        CHECK(it.find<value_tile>(name).value().isEmpty());
    }
    CHECK(it.find<value_tile>("sog").value() == "0.0");
    CHECK(it.find<QLabel>("mode").text() == "Heading · 15 min");
    it.now += 890s;
    it.hear(n);
    it.show();
    CHECK(it.find<QLabel>("mode").text().startsWith("Heading · "));
    CHECK(it.find<QLabel>("mode").text().endsWith(" s"));
}

TEST_CASE("console windows: a long reason in the log is wrapped, not cut") {
    desk it(true, {1024, 600});
    it.state.asked(5, xbee_path, commands::tack_now(), it.now);
    it.state.on_outcome(5, command_phase::refused, std::nullopt,
                        "no tack: it sails straight for the mark, and it will do so for the next hour or so", it.now);
    it.state.asked(6, xbee_path, commands::ping(), it.now);
    it.window->show_tab("log");
    it.show();
    auto& log = it.find<QTableWidget>("command_table");
    CHECK(log.rowHeight(1) >= 3 * QFontMetrics(log.font()).lineSpacing());
    CHECK(log.horizontalHeader()->length() <= log.viewport()->width());
    it.picture("log-wrapped");
}

TEST_CASE("console windows: an alarm is played by a program, again as it calls, and kept in a log") {
    QTemporaryDir folder;
    auto player = script_in(folder, "head -c 4 \"$1\" >>played\n");
    auto content = [&] { return played_in(folder); };
    desk it(true, {1280, 800}, folder.filePath("console.ini"), player);
    power p;
    p.battery_percent = 6;
    it.hear(p);
    it.show();
    wait_for([&] { return content() == "RIFF"; });
    CHECK(content() == "RIFF");
    it.show(); // the same call is heard once
    auto* sound = it.window->findChild<alarm_sound*>();
    REQUIRE(sound);
    wait_for([&] { return !sound->playing(); });
    it.now += 5s;
    it.show();
    wait_for([&] { return content() == "RIFFRIFF"; });
    CHECK(content() == "RIFFRIFF");
    it.state.acknowledge("battery", it.now);
    it.show();
    QFile log(folder.filePath("alarms.log"));
    REQUIRE(log.open(QIODevice::ReadOnly));
    auto lines = log.readAll();
    CHECK(lines.contains("critical\traised\tThe battery is low: 6 %"));
    CHECK(lines.contains("critical\tacknowledged"));
    it.window->show_tab("alarms");
    it.find("show_alarm_log").click();
    it.show();
    CHECK(it.find<QTableWidget>("alarm_log").rowCount() == 2);
    it.picture("alarm-log");
    // Without a player, the bell rings, and the operator knows.
    QString said;
    alarm_sound broken(folder.filePath("missing"));
    QObject::connect(&broken, &alarm_sound::failed, [&](const QString& why) { said = why; });
    broken.play(severity::critical);
    wait_for([&] { return !said.isEmpty(); });
    CHECK(said.contains("only the bell rings"));
    CHECK(alarm_wave(severity::critical).startsWith("RIFF"));
    CHECK(alarm_wave(severity::critical).size() > alarm_wave(severity::warning).size());
}

TEST_CASE("console windows: a player that hangs silences no alarm, and a graver alarm replaces the sound of another") {
    start_qt();
    QTemporaryDir folder;
    auto player = script_in(folder, "basename \"$1\" >>played\nexec sleep 600\n");
    auto content = [&] { return played_in(folder); };
    alarm_sound sound(player, nullptr, 1h);
    sound.play(severity::warning);
    wait_for([&] { return !content().isEmpty(); });
    sound.play(severity::notice);
    sound.play(severity::warning);
    CHECK(content() == "alarm-1.wav\n");
    sound.play(severity::critical);
    wait_for([&] { return content().contains("alarm-2"); });
    CHECK(content() == "alarm-1.wav\nalarm-2.wav\n");
    CHECK(sound.playing());
    QString said;
    alarm_sound hangs(player, nullptr, 1ms);
    QObject::connect(&hangs, &alarm_sound::failed, [&](const QString& why) { said = why; });
    hangs.play(severity::critical);
    wait_for([&] { return !said.isEmpty(); });
    CHECK(said.contains("does not end"));
    CHECK_FALSE(hangs.playing());
    hangs.play(severity::notice); // the next alarm is tried again
    CHECK(hangs.playing());
}

TEST_CASE("console windows: a route goes out as GPX and comes back, and what is none is refused with its line") {
    auto text_of = [](const std::string& gpx) { return QByteArray::fromStdString(gpx); };
    std::vector<waypoint> points{{28.153, -15.448}, {-33.5, 151.25}, {0, 180}};
    auto read = route_from_gpx(text_of(route_to_gpx("A & B <1>", points)));
    CHECK(read.trouble.toStdString() == "");
    CHECK(read.points == points);
    CHECK(read.name == "A & B <1>");
    auto loose = route_from_gpx(R"(<gpx version="1.0"><wpt lat="1" lon="2"><name>x</name></wpt><trk><trkseg>
        <trkpt lat="3" lon="4"/></trkseg></trk></gpx>)");
    CHECK(loose.points == std::vector<waypoint>{{1, 2}});
    auto two = route_from_gpx(R"(<gpx><rte><rtept lat="1" lon="2"/></rte><rte><rtept lat="9" lon="9"/></rte></gpx>)");
    CHECK(two.points == std::vector<waypoint>{{1, 2}});
    for (const char* bad :
         {"", "no xml", "<kml/>", "<gpx></gpx>", "<gpx><rte><rtept lat=\"91\" lon=\"0\"/></rte></gpx>",
          "<gpx><rte><rtept lat=\"nan\" lon=\"0\"/></rte></gpx>", "<gpx><rte><rtept lat=\"1\"",
          "<gpx><rte><rtept lon=\"1\"/></rte></gpx>"}) {
        INFO(bad);
        auto none = route_from_gpx(bad);
        CHECK_FALSE(none.trouble.isEmpty());
        CHECK(none.points.empty());
    }
    QByteArray many = "<gpx><rte>";
    for (int i = 0; i < 101; ++i) many += "<rtept lat=\"1\" lon=\"2\"/>";
    CHECK(route_from_gpx(many + "</rte></gpx>").trouble.contains("100"));
    // An entity that grows without bound is not resolved.
    auto bomb = route_from_gpx(R"(<!DOCTYPE g [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
        <!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;"><!ENTITY d "&c;&c;&c;&c;&c;&c;&c;&c;&c;&c;">
        <!ENTITY e "&d;&d;&d;&d;&d;&d;&d;&d;&d;&d;">]><gpx><rte><name>&e;</name></rte></gpx>)");
    CHECK_FALSE(bomb.trouble.isEmpty());

    QTemporaryDir folder;
    desk it;
    it.window->draft().replace(points);
    CHECK(it.window->export_route(folder.filePath("r.gpx")).isEmpty());
    it.window->draft().clear();
    CHECK(it.window->import_route(folder.filePath("r.gpx")).isEmpty());
    CHECK(it.window->draft().points() == points);
    it.window->draft().undo();
    CHECK(it.window->draft().points().empty());
    CHECK(it.window->import_route(folder.filePath("none.gpx")).contains("cannot read"));
}
