// The windows of the console, driven as an operator does.
#include "desk.hpp"

#include <apps/console/chart_viewport.hpp>
#include <apps/console/theme.hpp>
#include <apps/console/units.hpp>

#include <QComboBox>
#include <QStatusBar>

using namespace console_test;

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
    CHECK(it.last<give_command>()->command == boat_command(commands::set_mode{sailing_mode::hold}));
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

TEST_CASE("console windows: a mode that nothing newer confirms is shown with its age, and lights no button") {
    desk it;
    auto& automatic = it.find("mode_2");
    auto& mode = it.find<QLabel>("mode");
    CHECK(mode.text() == "Auto");
    it.now += 20s; // ageing
    it.show();
    CHECK(automatic.isChecked());
    it.now += 10min;
    it.show();
    CHECK_FALSE(automatic.isChecked());
    CHECK(mode.text() == "Auto? 10 min");
    CHECK(mode.toolTip().contains("10 min ago"));
    CHECK(mode.styleSheet().contains(colours().warn.name()));
    CHECK(QFontMetrics(mode.font()).horizontalAdvance("Heading? 10 min") <= mode.width());
    it.picture("stale-mode");
    navigation n;
    n.mode = sailing_mode::automatic;
    it.hear(n);
    it.show();
    CHECK(automatic.isChecked());
    CHECK(mode.text() == "Auto");
    talker second;
    second.boot = beacon_boot;
    it.state.on_telemetry(iridium_path, second.say(at(28.155, -15.452), it.now - 200ms, link_id::iridium), it.now);
    it.show();
    CHECK(mode.text() == "mode not known");
    CHECK_FALSE(automatic.isChecked());
}

TEST_CASE("console windows: a double click and a key that is held send a command once") {
    desk it;
    auto usual = QApplication::doubleClickInterval();
    QApplication::setDoubleClickInterval(3'600'000);
    it.find("do_tack").click();
    it.find("do_tack").click();
    CHECK(it.actions.size() == 1);
    it.find("do_ping").click(); // another one goes at once
    CHECK(it.actions.size() == 2);
    QApplication::setDoubleClickInterval(0); // it is over
    it.find("do_ping").click();
    CHECK(it.actions.size() == 3);
    QApplication::setDoubleClickInterval(usual);
    for (auto* each : it.window->findChildren<QAction*>()) {
        if (each->shortcut().isEmpty()) continue;
        INFO(each->text().toStdString());
        bool zooms = each->shortcut() == QKeySequence("+") || each->shortcut() == QKeySequence("-");
        CHECK(each->autoRepeat() == zooms);
    }
}

TEST_CASE("console windows: the time of arrival does not move away while nothing newer comes") {
    desk it;
    auto& eta = it.find<value_tile>("eta");
    auto told = [&] { return eta.accessibleDescription().section(',', 0, 0); };
    auto before = told();
    REQUIRE(before.contains(':'));
    it.now += 3min;
    it.show();
    CHECK(told() == before);
}

TEST_CASE("console windows: north is 000°, and places on both sides of 180° are neighbours") {
    CHECK(bearing_text(359.7) == "000°");
    CHECK(bearing_text(7.2) == "007°");
    chart_viewport view;
    view.projection.size = {600, 400};
    view.fit({{-17, 179.9}, {-17, -179.9}});
    CHECK(std::abs(view.projection.centre.longitude_deg) == Approx(180));
    CHECK(view.projection.metres_per_pixel < 200);
    auto west = view.projection.to_pixels({-17, 179.9}), east = view.projection.to_pixels({-17, -179.9});
    CHECK(west.x() < 300);
    CHECK(east.x() > 300);
    CHECK(east.x() - west.x() < 600);
    CHECK(view.projection.to_place(east).longitude_deg == Approx(-179.9)); // a click there is a valid waypoint
    CHECK(view.projection.to_place(west).longitude_deg == Approx(179.9));
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
    CHECK(it.last<give_command>()->command.kind() == command_kind::tack_now);
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
        it.answer_next("Hold to send");
        it.find(name).click();
        CHECK(it.last<give_command>());
        it.actions.clear();
    }
}

TEST_CASE("console windows: waypoints are edited by mouse, taken back, and uploaded when that is confirmed") {
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
    CHECK(it.find<QLabel>("mission_state").text().contains("the boat has 3, the list here has 4"));
    it.picture("mission");
    // A snapshot never overwrites what is edited.
    it.show();
    CHECK(draft.points().size() == 4);
    auto key = [&](const char* name) {
        for (auto* each : it.window->findChildren<QAction*>())
            if (each->shortcut() == QKeySequence(name)) each->trigger();
    };
    it.answer_next("Cancel");
    key("Ctrl+U");
    CHECK(it.actions.empty());
    it.answer_next("Hold to send");
    key("Ctrl+U");
    REQUIRE(it.last<upload_mission>());
    CHECK_FALSE(it.last<upload_mission>()->over_limits);
    CHECK(it.last<upload_mission>()->points == draft.points());
    it.click(chart.projection().to_pixels(draft.points()[0]), Qt::RightButton);
    CHECK(draft.points().size() == 3);
    it.find("undo").click();
    CHECK(draft.points().size() == 4);
    it.find("take_over").click();
    CHECK(draft.points() == course);
    CHECK_FALSE(draft.edited());
}

TEST_CASE("console windows: \"Sail to\" is offered where the boat's list has the same waypoint") {
    desk it;
    auto& draft = it.window->draft();
    draft.select(2);
    CHECK(it.find("go").isEnabled());
    draft.insert(1, {28.1570, -15.4500}); // then the third here is the second there
    draft.select(2);
    CHECK_FALSE(it.find("go").isEnabled());
    draft.select(3);
    CHECK_FALSE(it.find("go").isEnabled());
    draft.select(0);
    REQUIRE(it.find("go").isEnabled());
    it.find("go").click();
    REQUIRE(it.last<give_command>());
    CHECK(it.last<give_command>()->command == boat_command(commands::waypoint_select{0}));
}

TEST_CASE("console windows: an empty list clears the boat's only after the question") {
    desk none(false);
    CHECK_FALSE(none.find("upload").isEnabled()); // no list is known, and none was made
    desk it;
    it.window->draft().clear();
    auto& upload = it.find("upload");
    REQUIRE(upload.isEnabled());
    it.answer_next("");
    Q_EMIT upload.clicked(); // as after a second
    CHECK(it.asked.contains("Clear the boat's list"));
    CHECK(it.actions.empty());
    it.answer_next("Hold to send");
    Q_EMIT upload.clicked();
    REQUIRE(it.last<upload_mission>());
    CHECK(it.last<upload_mission>()->points.empty());
    it.window->draft().insert(0, course[0]);
    it.actions.clear();
    Q_EMIT upload.clicked(); // holding is the confirmation
    REQUIRE(it.last<upload_mission>());
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
