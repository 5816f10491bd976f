// The console without a mouse, for eyes and for ears.
#include "desk.hpp"

#include <apps/console/theme.hpp>

#include <QAccessible>
#include <QComboBox>
#include <QKeyEvent>
#include <QTabWidget>

#include <cmath>
#include <set>

using namespace console_test;

namespace {

std::vector<QWidget*> takes_keys(QWidget& window) {
    std::vector<QWidget*> all;
    for (auto* each : window.findChildren<QWidget*>())
        if (each->isVisible() && each->isEnabled() && (each->focusPolicy() & Qt::TabFocus) && !each->focusProxy() &&
            each->window() == &window)
            all.push_back(each);
    return all;
}

std::string told_of(QWidget* which) {
    return (QString(which->metaObject()->className()) + " '" + which->objectName() + "'").toStdString();
}

/// As WCAG has it: 1 to 21.
double contrast(const QColor& a, const QColor& b) {
    auto light = [](const QColor& c) {
        auto part = [](float of) {
            auto v = static_cast<double>(of);
            return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
        };
        return 0.2126 * part(c.redF()) + 0.7152 * part(c.greenF()) + 0.0722 * part(c.blueF());
    };
    double one = light(a), other = light(b);
    return (std::max(one, other) + 0.05) / (std::min(one, other) + 0.05);
}

} // namespace

TEST_CASE("console windows: what takes the keyboard has a name, shows that it has it, and Tab comes by") {
    desk it;
    it.window->activateWindow();
    QApplication::processEvents();
    REQUIRE(it.window->isActiveWindow());
    auto& tabs = it.find<QTabWidget>("tabs");
    for (int place = 0; place < tabs.count(); ++place) {
        tabs.setCurrentIndex(place);
        it.show();
        INFO("list: " << tabs.tabText(place).toStdString());
        auto all = takes_keys(*it.window);
        REQUIRE(all.size() > 15);
        for (auto* each : all) {
            INFO(told_of(each));
            auto* heard = QAccessible::queryAccessibleInterface(each);
            REQUIRE(heard);
            CHECK_FALSE(heard->text(QAccessible::Name).trimmed().isEmpty());
            it.window->setFocus();
            QApplication::processEvents();
            auto before = each->grab().toImage();
            each->setFocus(Qt::TabFocusReason);
            REQUIRE(each->hasFocus());
            QApplication::processEvents();
            CHECK(each->grab().toImage() != before);
        }
        std::set<QWidget*> reached;
        all.front()->setFocus(Qt::TabFocusReason);
        while (reached.insert(QApplication::focusWidget()).second) {
            QKeyEvent press(QEvent::KeyPress, Qt::Key_Tab, Qt::NoModifier);
            QApplication::sendEvent(QApplication::focusWidget(), &press);
            REQUIRE(QApplication::focusWidget());
        }
        for (auto* each : all) {
            INFO("Tab comes by " << told_of(each));
            CHECK(reached.count(each) == 1);
        }
    }
}

TEST_CASE("console windows: Tab goes from the links to the power of their modem, and back") {
    desk it;
    it.window->activateWindow();
    it.window->show_tab("links");
    it.show();
    auto& power = it.find<QComboBox>(("power of " + std::string(xbee_path)).c_str());
    REQUIRE(power.isVisible());
    REQUIRE(power.isEnabled());
    auto* area = power.parentWidget();
    while (area && area->accessibleName() != "Links") area = area->parentWidget();
    REQUIRE(area);
    area->setFocus(Qt::TabFocusReason);
    REQUIRE(area->hasFocus());
    auto press = [](Qt::Key which, Qt::KeyboardModifiers with) {
        QKeyEvent pressed(QEvent::KeyPress, which, with);
        QApplication::sendEvent(QApplication::focusWidget(), &pressed);
    };
    press(Qt::Key_Tab, Qt::NoModifier);
    CHECK(QApplication::focusWidget() == &power);
    press(Qt::Key_Backtab, Qt::ShiftModifier);
    CHECK(QApplication::focusWidget() == area);
}

TEST_CASE("console windows: every key of the menus is told by Shift+F1") {
    desk it;
    QString message;
    QTimer::singleShot(0, it.window.get(), [&] {
        auto* box = qobject_cast<QMessageBox*>(QApplication::activeModalWidget());
        REQUIRE(box);
        message = box->text();
        if (const char* to = std::getenv("CONSOLE_PICTURES")) box->grab().save(QString(to) + "/keys.png");
        box->reject();
    });
    std::size_t keys = 0;
    for (auto* each : it.window->findChildren<QAction*>())
        if (each->shortcut() == QKeySequence("Shift+F1")) each->trigger();
    for (auto* each : it.window->findChildren<QAction*>()) {
        if (each->shortcut().isEmpty()) continue;
        ++keys;
        INFO(each->text().toStdString());
        CHECK(message.contains("<b>" + each->shortcut().toString(QKeySequence::NativeText).toHtmlEscaped() + "</b>"));
    }
    CHECK(keys > 30);
}

TEST_CASE("console windows: words can be read in all palettes") {
    desk it;
    for (const char* name : {"day", "night", "red"}) {
        it.window->set_night(name == std::string("night"));
        it.window->set_red(name == std::string("red"));
        const auto& t = colours();
        INFO(name);
        for (const auto& back : {t.card, t.field, t.page})
            for (const auto& ink : {t.ink, t.ink2, t.ink3, t.accent, t.good, t.warn, t.bad}) {
                INFO(ink.name().toStdString() << " on " << back.name().toStdString());
                CHECK(contrast(ink, back) >= 4.5);
            }
        CHECK(contrast(t.warn, t.warn_back) >= 4.5);
        CHECK(contrast(t.bad, t.bad_back) >= 4.5);
        CHECK(contrast(t.accent, t.notice_back) >= 4.5);
        CHECK(contrast(t.sea_text, t.sea) >= 4.5);
        CHECK(contrast(t.place, t.land) >= 4.5);
        for (const auto& link : t.links) CHECK(contrast(link, t.sea) >= 3); // a line
    }
    for (const auto& ink : {colours().ink, colours().accent, colours().good, colours().warn, colours().bad,
                            colours().page, colours().sea, colours().land, colours().leg})
        CHECK(ink.blue() <= ink.red() * 2 / 3); // the last one is the red palette: it leaves the eyes used to the dark
    it.picture("red");
    it.window->set_red(false);
}

TEST_CASE("console windows: each link tells what only its kind has, and what is old says so") {
    desk it;
    it.window->show_tab("links");
    gprs_state carrier;
    carrier.connected = true;
    carrier.from = "tcp://10.64.0.9:40112";
    carrier.connected_since = it.now - 2160s;
    carrier.acknowledged = 1188;
    carrier.announced = 1190;
    carrier.not_safe_yet = 1;
    carrier.today = {1'840'000, 260'000};
    carrier.this_month = {31'000'000, 4'000'000};
    carrier.budget = budget_after(2'000'000, 2'100'000, 50'000'000, 35'000'000);
    carrier.budget_notice = "today's budget is spent: it goes on at 00:00 UTC";
    it.state.on_gprs(gprs_path, carrier, it.now);
    it.state.on_link(iridium_path, true, "", t0);
    iridium_account account;
    account.last_session_at = it.now - 7s;
    account.today.mo_credits = 207;
    account.today.mt_credits = 4;
    account.daily_budget = 50;
    account.budget_left = 46;
    iridium_queued waiting;
    waiting.kind = command_kind::set_mode;
    waiting.stage = link_stage::at_gateway;
    account.queue = {waiting};
    it.state.on_account(iridium_path, account, it.now);
    it.show();
    auto words = [&](const char* name) { return it.find<QLabel>(name).text(); };
    CHECK(words("gprs_way").contains("10.64.0.9:40112"));
    CHECK(words("gprs_safe") == "1188 of 1190");
    CHECK(words("gprs_behind").contains(">2<"));
    CHECK(words("iridium_session") == "7 s ago");
    CHECK(words("iridium_today") == "207 + 4");
    CHECK(words("iridium_budget").contains("46 of 50"));
    CHECK(words("gprs_today") == "1.8 MB + 260.0 kB");
    CHECK(words("gprs_budget").contains(">0 B of 2.0 MB</span> today"));
    CHECK(words("gprs_budget").contains(">15.0 MB of 50.0 MB</span> this month"));
    CHECK(find(it.state.view(it.now)->alarms, "budget:" + gprs_path)->text ==
          "GPRS: today's budget is spent: it goes on at 00:00 UTC");
    CHECK(words("iridium_queue") == "set mode: at the gateway, until the boat's next session");
    it.picture("links-all");
    carrier.connected = false;
    carrier.last_heard = it.now;
    it.state.on_gprs(gprs_path, carrier, it.now);
    it.now += 60s;
    it.show();
    CHECK(words("gprs_way").contains("not there"));
    CHECK(words("gprs_way").contains("reported 60 s ago"));
}

TEST_CASE("console windows: an apparent wind that belongs to another heading is not shown as the present one") {
    desk it;
    auto* dial = it.window->findChild<wind_dial*>();
    REQUIRE(dial);
    CHECK(dial->accessibleDescription().contains("apparent wind at 55°"));
    it.now += 40s;
    navigation tacked;
    tacked.heading_deg = 80;
    it.hear(tacked);
    it.show();
    CHECK(dial->accessibleDescription().contains("Heading 80°, true wind from 45°"));
    CHECK_FALSE(dial->accessibleDescription().contains("apparent"));
}
