#include "window_operator.hpp"

#include <apps/console/chart_view.hpp>
#include <apps/console/console_window.hpp>
#include <apps/console/hold_button.hpp>

#include <QApplication>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QMenu>
#include <QMenuBar>
#include <QMessageBox>
#include <QRegularExpression>
#include <QTabBar>
#include <QTabWidget>
#include <QTableWidget>
#include <QTime>

#include <algorithm>
#include <utility>

namespace atirma::console {
namespace {

using namespace std::chrono_literals;

constexpr auto beat_period = 20ms;
constexpr int held_ms = hold_button::hold_ms + 200;
constexpr int mission_list = 1, boat_list = 3, log_list = 4, lists = 7; // the keys F1 … F7

utc_time now() { return std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now()); }

/// The last time of day that the window shows like this.
utc_time time_shown(const QString& clock) {
    auto time = QTime::fromString(clock, "HH:mm:ss");
    auto at = std::chrono::floor<std::chrono::days>(now()) + std::chrono::milliseconds(time.msecsSinceStartOfDay());
    return at > now() ? at - std::chrono::days(1) : at;
}

bool passed(const QElapsedTimer& since, std::chrono::milliseconds what) { return since.hasExpired(what.count()); }

} // namespace

window_operator::window_operator(console_window& window, window_operator_options options)
    : window_(window), options_(std::move(options)), dice_(options_.seed, options_.name) {
    since_start_.start();
    since_order_.start();
    since_list_.start();
    since_beat_.start();
    next_order_ = 5s;
    beating_.setTimerType(Qt::PreciseTimer);
    connect(&beating_, &QTimer::timeout, this, &window_operator::beat);
    beating_.start(beat_period);
    window_.activateWindow();
    look();
}

void window_operator::beat() {
    auto late = since_beat_.restart() - std::chrono::milliseconds(beat_period).count();
    if (late <= view_.longest_stall_ms) return;
    view_.longest_stall_ms = late;
    view_.stalled_at = now();
}

/// A timer for each look: dialogs and menus open within one, and the next ones answer them.
void window_operator::look() {
    QTimer::singleShot(static_cast<int>(150 + dice_.below(700)), this, &window_operator::look);
    if (hands_.holding()) return;
    auto* popup = QApplication::activePopupWidget();
    if (auto* menu = qobject_cast<QMenu*>(popup)) return choose_from(*menu);
    if (popup) return hands_.key(QKeySequence(Qt::Key_Escape));
    if (auto* dialog = QApplication::activeModalWidget()) return answer(*dialog);
    if (acting_) return;
    if (!window_.isActiveWindow()) return window_.activateWindow(); // a dialog has closed; here is no window manager
    acting_ = true;
    act();
    acting_ = false;
}

void window_operator::act() {
    read_list();
    path_.clear();
    bool undecided = any_open();
    bool leaving = leaving_since_.isValid();
    if (leaving && ((!undecided && passed(leaving_since_, 5s)) || passed(leaving_since_, options_.patience))) {
        hands_.key(QKeySequence("Home")); // for the last picture
        if (options_.left) std::exchange(options_.left, {})();
        return;
    }
    if (passed(since_order_, next_order_) && !leaving) return give_telecommand();
    // After a telecommand the eyes stay on the list, and return to it until it is decided.
    bool fresh = undecided && !passed(since_order_, 6s);
    if (fresh || leaving || (undecided && passed(since_list_, 8s))) {
        since_list_.start();
        return show_list(log_list);
    }
    look_around();
}

// --- telecommands ---------------------------------------------------------------------------------------------------

std::chrono::milliseconds window_operator::pause_between_orders() {
    auto usual = std::clamp<std::chrono::milliseconds>(options_.length * 12 / 1000, 4s, 3min);
    return usual * static_cast<int>(60 + dice_.below(80)) / 100;
}

void window_operator::give_telecommand() {
    next_order_ = pause_between_orders();
    if (!next_.empty()) {
        auto what = std::move(next_.front());
        next_.pop_front();
        what();
    } else if (dice_.chance(options_.steers ? 0.5 : 0.1) && !course_changes()) {
        steer_boat();
    } else {
        ask_boat();
    }
    since_order_.start();
}

/// Gives a telecommand that needs no authority.
void window_operator::ask_boat() {
    switch (dice_.below(8)) {
        case 0: return click("do_ping");
        case 1: return hands_.key(QKeySequence("Ctrl+P"));
        case 2: return hands_.key(QKeySequence("Ctrl+I"));
        case 3: show_list(mission_list); return click("read_back");
        case 4: return open_menu("Boat", {"All telecommands", "telecommand_get_parameter"});
        case 5: return open_menu("Boat", {"Validity of commands", dice_.chance(0.5) ? "2 min" : "30 s"});
        case 6: choose_link(); return click("do_ping");
        default: hands_.key(QKeySequence("Ctrl+I")); return call_back();
    }
}

/// Gives a telecommand that needs the authority; the console asks whether to take it.
void window_operator::steer_boat() {
    switch (dice_.below(8)) {
        case 0: next_.push_back([this] { click("mode_2"); }); return click("mode_1");
        case 1:
            next_.push_back([this] { hands_.key(QKeySequence("Ctrl+1")); });
            return hands_.key(QKeySequence("Ctrl+3"));
        case 2: return hands_.key(QKeySequence("Ctrl+T"));
        case 3: return set_parameter("leeway_compensation", static_cast<double>(dice_.below(5)) * 0.25);
        case 4: return set_parameter("time_to_next_tack", static_cast<double>(60 + 30 * dice_.below(8)));
        case 5: // dangerous: the button of the question is held
            next_.push_back([this] { set_parameter("fence", 1); });
            return set_parameter("fence", 0);
        case 6: return upload();
        default: // the authority itself
            path_ = {"*"};
            return click("command");
    }
}

/// Another operator changes the course in the middle of the mission, and needs the authority for it.
bool window_operator::course_changes() const {
    auto part = static_cast<double>(since_start_.elapsed()) /
                static_cast<double>(std::chrono::milliseconds(options_.length).count());
    return part > 0.4 && part < 0.7;
}

/// The boat's own list, sent again.
void window_operator::upload() {
    show_list(mission_list);
    const auto* table = find<QTableWidget>("mission_table");
    auto* button = find<QAbstractButton>("upload");
    if (table->rowCount() > 0 && button->isEnabled()) hands_.hold(*button, held_ms);
}

void window_operator::set_parameter(const QString& name, double value) {
    show_list(boat_list);
    auto* box = find<QDoubleSpinBox>("wanted_" + name);
    hands_.click(*box, QPoint(10, box->height() / 2));
    hands_.type(QString::number(value));
    click("set_" + name);
}

/// For the telecommands from now on: one down, or back to the first.
void window_operator::choose_link() {
    auto* box = find<QComboBox>("link_choice");
    box->setFocus(Qt::TabFocusReason);
    hands_.key(QKeySequence(box->currentIndex() + 1 < box->count() && dice_.chance(0.4) ? Qt::Key_Down : Qt::Key_Home));
}

void window_operator::call_back() {
    show_list(log_list);
    auto* table = find<QTableWidget>("command_table");
    if (!table->isVisible()) return;
    hands_.click(*table->viewport(), QPoint(120, 8)); // the newest
    auto* button = find<QAbstractButton>("call_back");
    if (button->isEnabled() && dice_.chance(0.5)) hands_.click(*button);
}

// --- what opens -----------------------------------------------------------------------------------------------------

void window_operator::open_menu(const QString& title, QStringList path) {
    path_ = std::move(path);
    for (auto* each : window_.menuBar()->actions())
        if (each->text().remove('&') == title)
            hands_.click(*window_.menuBar(), window_.menuBar()->actionGeometry(each).center());
}

/// The next of the path: an action's name or the beginning of its text; "*": any.
void window_operator::choose_from(QMenu& menu) {
    std::vector<QAction*> fit;
    auto wanted = path_.isEmpty() ? QString() : path_.takeFirst();
    for (auto* each : menu.actions())
        if (each->isEnabled() && !each->isSeparator() && !wanted.isEmpty() &&
            (wanted == "*" || each->objectName() == wanted || each->text().remove('&').startsWith(wanted)))
            fit.push_back(each);
    if (fit.empty()) {
        path_.clear();
        return hands_.key(QKeySequence(Qt::Key_Escape));
    }
    auto* chosen = fit[dice_.below(fit.size())];
    auto place = menu.actionGeometry(chosen).center();
    if (menu.rect().contains(place) && dice_.chance(0.7)) return hands_.click(menu, place);
    for (int n = 0; n < menu.actions().size() && menu.activeAction() != chosen; ++n)
        hands_.key(QKeySequence(Qt::Key_Down));
    hands_.key(QKeySequence(Qt::Key_Return));
}

void window_operator::answer(QWidget& dialog) {
    QAbstractButton* wanted = nullptr;
    if (dialog.objectName() == "telecommand") {
        wanted = dialog.findChild<QAbstractButton*>("telecommand_accept");
    } else if (dialog.objectName() == "authority") {
        bool takes = options_.steers ? dice_.chance(0.8) : dice_.chance(0.2);
        for (auto* each : dialog.findChildren<QAbstractButton*>())
            if (each->text().startsWith(takes ? "Take it" : "Ask")) wanted = each;
    } else if (auto* button = dialog.findChild<hold_button*>(); button && dice_.chance(0.85)) {
        return hands_.hold(*button, dice_.chance(0.9) ? held_ms : held_ms / 4);
    }
    if (wanted && wanted->isEnabled()) return hands_.click(*wanted);
    hands_.key(QKeySequence(Qt::Key_Escape));
}

// --- what is seen ---------------------------------------------------------------------------------------------------

void window_operator::show_list(int number) {
    if (dice_.chance(0.5)) return hands_.key(QKeySequence(Qt::Key_F1 + number - 1));
    auto* bar = find<QTabWidget>("tabs")->tabBar();
    hands_.click(*bar, bar->tabRect(number - 1).center());
    if (bar->currentIndex() != number - 1) hands_.key(QKeySequence(Qt::Key_F1 + number - 1)); // out of sight
}

/// Of this window's telecommands.
void window_operator::read_list() {
    static const QRegularExpression in_tip("\nid (\\d+), .*, last change (\\d\\d:\\d\\d:\\d\\d)");
    const auto* table = find<QTableWidget>("command_table");
    if (!table->isVisible()) return;
    for (int row = 0; row < table->rowCount(); ++row) {
        if (!table->item(row, 3)->text().startsWith("here")) continue;
        auto tip = in_tip.match(table->item(row, 0)->toolTip());
        auto& note = notes_[tip.captured(1).toUInt()];
        note.given = time_shown(table->item(row, 0)->text());
        auto words = table->item(row, 1)->text();
        note.what = words.section('\n', 0, 0).toStdString();
        note.words = words.section('\n', 1).toStdString();
        auto phase = table->item(row, 2)->text().section(' ', 1).section(',', 0, 0);
        note.phase = phase == "too late" ? "late" : phase.toStdString();
        note.accepted = note.accepted || QStringList{"queued", "sent", "done", "too late"}.contains(phase);
        if (note.has_ended()) note.ended = time_shown(tip.captured(2));
    }
    unread_ = false;
}

bool window_operator::any_open() const {
    return unread_ || std::ranges::any_of(notes_, [](const auto& one) { return !one.second.has_ended(); });
}

void window_operator::look_around() {
    auto& chart = window_.chart();
    auto somewhere = [&] {
        return QPoint(60 + static_cast<int>(dice_.below(static_cast<std::uint64_t>(std::max(1, chart.width() - 120)))),
                      40 + static_cast<int>(dice_.below(static_cast<std::uint64_t>(std::max(1, chart.height() - 90)))));
    };
    switch (dice_.below(16)) {
        case 0: return hands_.drag(chart, somewhere(), somewhere());
        case 1:
        case 2: return hands_.wheel(chart, dice_.chance(0.5) ? 1 : -1);
        case 3: return hands_.key(QKeySequence(dice_.chance(0.5) ? "+" : "-"));
        case 4: return hands_.key(QKeySequence("Home"));
        case 5: return hands_.key(QKeySequence("F"));
        case 6: // measures a distance
            hands_.key(QKeySequence("M"));
            hands_.click(chart, somewhere());
            hands_.click(chart, somewhere());
            return hands_.key(QKeySequence("M"));
        case 7: // a waypoint more in the list edited here, and away again
            hands_.key(QKeySequence("Ctrl+E"));
            hands_.click(chart, somewhere());
            hands_.key(QKeySequence("Ctrl+E"));
            if (find<QAbstractButton>("take_over")->isEnabled()) click("take_over");
            return;
        case 8: path_ = {"Centre here"}; return hands_.click(chart, somewhere(), Qt::RightButton);
        case 9: return hands_.key(QKeySequence("Ctrl+N"));
        case 10:
            if (auto* button = find<QAbstractButton>("acknowledge_first"); button->isVisible()) hands_.click(*button);
            return;
        case 11: { // the bytes of a packet
            show_list(6);
            auto* table = find<QTableWidget>("packet_table");
            hands_.click(*table->viewport(), QPoint(40, 30));
            return hands_.key(QKeySequence(Qt::Key_Down));
        }
        case 12: return hands_.key(QKeySequence(dice_.chance(0.5) ? "Shift+F1" : "Ctrl+L"));
        default: return show_list(1 + static_cast<int>(dice_.below(lists)));
    }
}

window_view window_operator::seen() {
    beating_.stop();
    auto& chart = window_.chart();
    view_.name = options_.name;
    view_.left = !options_.left; // else it was cut short
    view_.status = find<QLabel>("status")->toolTip().toStdString();
    view_.place = chart.accessibleDescription().toStdString();
    view_.clicks = hands_.clicks();
    view_.keys = hands_.keys();
    view_.given = given_;
    for (const auto& [id, one] : notes_) {
        view_.commands.push_back(one);
        view_.commands.back().id = id;
    }
    return view_;
}

template <class Widget>
Widget* window_operator::find(const QString& name) {
    return window_.findChild<Widget*>(name);
}

void window_operator::click(const QString& button) {
    if (auto* found = find<QAbstractButton>(button); found && found->isEnabled()) hands_.click(*found);
}

} // namespace atirma::console
