// Several boats in one window: one is shown, and the alarms of all reach the operator.
#include "desk.hpp"

#include <apps/console/theme.hpp>

#include <QAction>
#include <QComboBox>
#include <QElapsedTimer>
#include <QFile>
#include <QStatusBar>
#include <QTabBar>
#include <QTabWidget>
#include <QTemporaryDir>

using namespace console_test;

namespace {

/// A desk for three boats: the first sails, the second has a position, the third was never heard.
struct fleet_desk : desk {
    explicit fleet_desk(QSize size = {1280, 800}, const QString& settings = {}, const QString& player = "none")
        : desk(true, size, settings, player, {"A-Tirma", "boat-2", "boat-3"}) {
        other.on_link("boat-2/shore/gprs", true, "", now);
        other.takes_commands("boat-2/shore/gprs");
        hear_other(at(28.2000, -15.3000)); // no land ahead
        navigation n;
        n.mode = sailing_mode::station_keep;
        hear_other(n);
        show_all();
    }
    void hear_other(const telemetry_body& body) {
        other.on_telemetry("boat-2/shore/gprs", other_talk.say(body, now - 600ms, link_id::gprs), now - 100ms);
    }
    void low_battery() {
        power p;
        p.battery_percent = 7;
        p.battery_v = 10.4f;
        hear_other(p);
    }
    void show_all() {
        other.on_time(now);
        window->show_snapshot(other.view(now), 1);
        show();
    }
    QString cell(int row, int column) { return find<QTableWidget>("fleet_table").item(row, column)->text(); }

    console_state other;
    talker other_talk{9, 0};
};

} // namespace

TEST_CASE("console fleet: with one boat there is neither a list of boats nor a choice") {
    desk it;
    CHECK_FALSE(it.window->findChild<QTableWidget*>("fleet_table"));
    CHECK_FALSE(it.window->findChild<QComboBox*>("boat_choice"));
    CHECK_FALSE(it.window->show_tab("fleet"));
    CHECK(it.window->windowTitle() == "A-Tirma console");
}

TEST_CASE("console fleet: the list has name, state, last contact, mode and alarms of each boat") {
    fleet_desk it;
    REQUIRE(it.window->show_tab("fleet"));
    it.low_battery();
    it.show_all();
    CHECK(it.find<QTableWidget>("fleet_table").rowCount() == 3);
    CHECK(it.cell(0, 0) == "▸ A-Tirma");
    CHECK(it.cell(0, 1) == "● live · XBee");
    CHECK(it.cell(1, 0) == "boat-2");
    CHECK(it.cell(1, 1) == "● live · GPRS");
    CHECK(it.cell(1, 2) == "now");
    CHECK(it.cell(1, 3) == "Loiter");
    CHECK(it.cell(1, 4) == "● 1");
    CHECK(it.cell(2, 1) == "● no boat yet");
    CHECK(it.cell(2, 2) == "–");
    CHECK(it.cell(2, 4) == "–");
    it.now += 15min; // by the rule of freshness, for a boat that is not shown, too
    it.show_all();
    CHECK(it.cell(1, 1) == "● no current data");
    CHECK(it.cell(1, 2) == "15 min");
    CHECK(it.cell(1, 4) == "● 3"); // silent boat, silent link, battery
}

TEST_CASE("console fleet: a switch shows another boat, and commands go to the boat that is shown") {
    fleet_desk it;
    it.find("do_ping").click();
    REQUIRE(it.last<give_command>());
    CHECK(it.acted_on.back() == 0);
    auto& choice = it.find<QComboBox>("boat_choice");
    CHECK(choice.currentText() == "A-Tirma");
    choice.setCurrentIndex(1);
    Q_EMIT choice.activated(1);
    QApplication::processEvents();
    CHECK(it.window->shown_boat() == 1);
    CHECK(it.window->windowTitle() == "boat-2 console");
    CHECK(it.find<QComboBox>("boat_choice").currentText() == "boat-2");
    CHECK(it.find<QLabel>("mode").text() == "Loiter");
    CHECK(it.find<QLabel>("status").text().contains("GPRS"));
    it.find("do_ping").click();
    CHECK(it.acted_on.back() == 1);
    // The first boat goes on unseen: its snapshots do not show here.
    it.show();
    CHECK(it.find<QLabel>("mode").text() == "Loiter");
    REQUIRE(it.window->show_tab("fleet"));
    auto& table = it.find<QTableWidget>("fleet_table");
    table.setCurrentCell(0, 0);
    it.find("show_boat").click();
    QApplication::processEvents();
    CHECK(it.window->shown_boat() == 0);
    CHECK(it.find<QTabWidget>("tabs").currentWidget()->property("tab").toString() == "fleet");
    CHECK(it.find<QLabel>("mode").text() == "Auto");
}

TEST_CASE("console fleet: what is entered for one boat does not reach another, and is there again afterwards") {
    fleet_desk it;
    it.window->draft().replace({{28.2, -15.4}, {28.3, -15.5}});
    auto& link = it.find<QComboBox>("link_choice");
    auto place = link.findData(QString::fromStdString(xbee_path));
    REQUIRE(place > 0);
    link.setCurrentIndex(place);
    Q_EMIT link.activated(place);
    it.find("do_ping").click();
    CHECK(it.last<give_command>()->via == xbee_path);
    it.window->show_boat(1);
    CHECK_FALSE(it.window->draft().edited());
    CHECK_FALSE(it.window->draft().can_undo());
    CHECK(it.find<QComboBox>("link_choice").findData(QString::fromStdString(xbee_path)) < 0);
    it.find("do_ping").click();
    CHECK(it.last<give_command>()->via.empty());
    it.window->show_boat(0);
    CHECK(it.window->draft().edited());
    CHECK(it.window->draft().points().size() == 2);
    CHECK(it.window->draft().can_undo());
    it.window->show_boat(7); // there is none
    CHECK(it.window->shown_boat() == 0);
}

TEST_CASE("console fleet: edited lists and acknowledged alarms of each boat outlive a restart, apart from each other") {
    QTemporaryDir folder;
    auto settings = folder.filePath("console.ini");
    {
        fleet_desk it({1280, 800}, settings);
        it.low_battery();
        it.show_all();
        it.other.acknowledge("", it.now);
        it.show_all();
        it.window->show_boat(1);
        it.window->draft().replace({{28.2, -15.4}, {28.3, -15.5}});
        it.window->close();
    }
    fleet_desk it({1280, 800}, settings);
    CHECK_FALSE(it.window->draft().edited());
    REQUIRE(it.actions.size() == 1); // to the second boat only
    REQUIRE(it.last<remember_alarms>());
    CHECK(it.acted_on.back() == 1);
    REQUIRE(it.last<remember_alarms>()->before.size() == 1);
    CHECK(it.last<remember_alarms>()->before[0].key == "battery");
    it.window->show_boat(1);
    CHECK(it.window->draft().edited());
    CHECK(it.window->draft().points().size() == 2);
    it.window->show_boat(2);
    CHECK_FALSE(it.window->draft().edited());
}

TEST_CASE("console fleet: an alarm of a boat that is not shown is told with its name, and acknowledged there") {
    QTemporaryDir folder;
    QFile player(folder.filePath("player"));
    REQUIRE(player.open(QIODevice::WriteOnly));
    player.write("#!/bin/sh\necho played >> \"" + folder.filePath("played").toUtf8() + "\"\n");
    player.close();
    player.setPermissions(QFile::ReadOwner | QFile::ExeOwner);
    fleet_desk it({1024, 600}, folder.filePath("console.ini"), player.fileName());
    it.low_battery();
    it.show_all();
    CHECK(it.window->statusBar()->currentMessage().startsWith("boat-2: The battery is low: 7 %"));
    auto strip = it.find<QLabel>("alarm_text").text();
    CHECK(strip.contains("boat-2: The battery is low"));
    CHECK(it.find<QComboBox>("boat_choice").itemText(1) == "boat-2 · 1");
    it.window->show_tab("fleet");
    it.show();
    it.picture("fleet-alarm");
    QFile log(folder.filePath("alarms.log"));
    REQUIRE(log.open(QIODevice::ReadOnly));
    CHECK(QString::fromUtf8(log.readAll()).contains("boat-2: The battery is low: 7 %"));
    QElapsedTimer since;
    since.start();
    while (!QFile::exists(folder.filePath("played")) && since.elapsed() < 60'000)
        QApplication::processEvents(QEventLoop::AllEvents, 20);
    CHECK(QFile::exists(folder.filePath("played")));
    it.now += 1s;
    it.find("acknowledge_first").click();
    REQUIRE(it.last<acknowledge_alarm>());
    CHECK(it.last<acknowledge_alarm>()->key == "battery");
    CHECK(it.acted_on.back() == 1);
    for (auto* button : it.find<QFrame>("alarm_strip").findChildren<QPushButton*>())
        if (button->text() == "Show") button->click();
    QApplication::processEvents();
    CHECK(it.window->shown_boat() == 1);
    CHECK(it.find<QTabWidget>("tabs").currentWidget()->property("tab").toString() == "alarms");
}

TEST_CASE(
    "console fleet: a boat whose component has ended is marked beside the alarms of the others, and gets nothing") {
    fleet_desk it;
    it.window->show_tab("fleet");
    it.window->end_boat(2, "its name was lost");
    it.show_all();
    auto strip = [&] { return it.find<QLabel>("alarm_text").text(); };
    CHECK(strip().startsWith("boat-3: The console has ended"));
    CHECK(it.cell(2, 1) == "● ended");
    CHECK(it.find("do_tack").isEnabled()); // the shown boat is followed
    it.low_battery();
    it.show_all();
    CHECK(strip().contains("boat-2: The battery is low"));
    CHECK(strip().contains("boat-3: The console has ended"));
    CHECK(it.find("acknowledge_first").isVisible());
    it.window->show_boat(2);
    it.show_all();
    CHECK(strip().startsWith("boat-3: The console has ended"));
    CHECK(strip().contains("its name was lost   + 1 more"));
    CHECK_FALSE(it.find("do_tack").isEnabled());
    it.window->show_boat(0);
    CHECK(it.find("do_tack").isEnabled());
}

TEST_CASE("console fleet: at 1024 x 600 all lists have a tab that can be read, and a switch moves nothing") {
    fleet_desk it({1024, 600});
    it.low_battery();
    it.show_all();
    auto& tabs = it.find<QTabWidget>("tabs");
    auto* bar = tabs.tabBar();
    auto rects = [&](QTabWidget& of) {
        QList<QRect> all;
        for (int i = 0; i < of.count(); ++i)
            all << of.tabBar()->tabRect(i).translated(of.tabBar()->mapTo(it.window.get(), QPoint()));
        for (const char* name : {"do_ping", "do_tack", "acknowledge_first"})
            all << QRect(it.find(name).mapTo(it.window.get(), QPoint()), it.find(name).size());
        for (QWidget* each : std::initializer_list<QWidget*>{&it.find<QLabel>("status"), &it.find<QLabel>("mode"),
                                                             &it.find<QComboBox>("boat_choice"), &it.window->chart()})
            all << QRect(each->mapTo(it.window.get(), QPoint()), each->size());
        return all;
    };
    CHECK(bar->tabRect(tabs.count() - 1).right() <= bar->width());
    CHECK(bar->mapTo(it.window.get(), QPoint(bar->width(), 0)).x() <= it.window->width());
    for (int i = 0; i < tabs.count(); ++i)
        CHECK(bar->tabRect(i).width() >= QFontMetrics(bar->font()).horizontalAdvance(tabs.tabText(i)));
    auto before = rects(tabs);
    it.picture("fleet-first");
    it.window->show_boat(1);
    it.show_all();
    it.picture("fleet-second");
    CHECK(rects(it.find<QTabWidget>("tabs")) == before);
    it.window->show_boat(2);
    it.show_all();
    it.picture("fleet-third");
    CHECK(rects(it.find<QTabWidget>("tabs")) == before);
}

TEST_CASE("console fleet: the other boats are on the chart with their names, and a double click shows one") {
    fleet_desk it;
    auto& all = it.find<QAction>("all_boats");
    all.trigger();
    QApplication::processEvents();
    auto* chart = &it.window->chart();
    CHECK(chart->accessibleDescription().contains("; boat-2 at "));
    CHECK_FALSE(chart->accessibleDescription().contains("boat-3")); // never heard
    auto other = chart->projection().to_pixels({28.2000, -15.3000}).toPoint();
    REQUIRE(chart->rect().contains(other));
    auto picture = it.window->chart().grab().toImage();
    CHECK(picture.pixelColor(other) == colours().ink2);
    it.picture("fleet-chart");
    auto asked = [&](QPoint at) {
        QMouseEvent twice(QEvent::MouseButtonDblClick, QPointF(at), chart->mapToGlobal(QPointF(at)), Qt::LeftButton,
                          Qt::LeftButton, Qt::NoModifier);
        QApplication::sendEvent(chart, &twice);
        QApplication::processEvents();
    };
    asked(other + QPoint(40, 40)); // beside it: nearer, as everywhere on the chart
    CHECK(it.window->shown_boat() == 0);
    all.trigger();
    asked(chart->projection().to_pixels({28.2000, -15.3000}).toPoint());
    CHECK(it.window->shown_boat() == 1);
    it.show_all();
    CHECK(it.window->chart().accessibleDescription().contains("; A-Tirma at "));
    CHECK_FALSE(it.window->chart().accessibleDescription().contains("boat-2"));
}

TEST_CASE("console fleet: snapshots of all boats come through their ports") {
    fleet_desk it;
    std::vector<std::shared_ptr<operator_port>> ports;
    for (int i = 0; i < 3; ++i) ports.push_back(std::make_shared<operator_port>());
    it.window->attach(ports);
    console_state third;
    talker talk;
    third.on_link("boat-3/shore/gprs", true, "", it.now);
    third.on_telemetry("boat-3/shore/gprs", talk.say(at(28.1, -15.4), it.now, link_id::gprs), it.now);
    ports[2]->publish(third.view(it.now));
    QApplication::processEvents();
    CHECK(it.cell(2, 1) == "● live · GPRS");
    it.window->attach({});
}
