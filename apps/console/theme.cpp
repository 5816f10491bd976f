#include "theme.hpp"

#include <QApplication>
#include <QEvent>
#include <QFontDatabase>
#include <QLabel>
#include <QPalette>
#include <QPointer>
#include <QStyleFactory>
#include <QWidget>

#include <algorithm>

namespace atirma::console {
namespace {

theme make_day() {
    theme t;
    t.page = QColor("#e9eff3"), t.card = QColor("#ffffff"), t.field = QColor("#f4f7f9"), t.ink = QColor("#10263a"),
    t.ink2 = QColor("#43596c"), t.ink3 = QColor("#586b7d"), t.line = QColor("#d5dfe7");
    t.accent = QColor("#0b62a4"), t.good = QColor("#14774a"), t.warn = QColor("#8a5a00"),
    t.warn_back = QColor("#fff0cc"), t.bad = QColor("#a8221b"), t.bad_back = QColor("#ffe1dc"),
    t.notice_back = QColor("#e3eefa");
    t.sea = QColor("#cfe3ee"), t.shore1 = QColor("#dfeef5"), t.shore2 = QColor("#d9eaf3"), t.shore3 = QColor("#d4e6f0"),
    t.land = QColor("#f3ead3"), t.coast = QColor("#a48f63"), t.place = QColor("#6d5d3a"),
    t.sea_text = QColor("#38657e"), t.graticule = QColor("#a9c7d8");
    t.route = QColor("#51708a"), t.leg = QColor("#c8431a"), t.draft = QColor("#7a3fb0"), t.no_go = QColor("#e7a79f"),
    t.true_wind = QColor("#a85f06"), t.apparent_wind = QColor("#0a7a6d"), t.hull = QColor("#d9481c"),
    t.deck = QColor("#ffe9d9");
    t.links[0] = QColor("#0b72b9"), t.links[1] = QColor("#1f8f58"), t.links[2] = QColor("#a8478f"),
    t.link_other = QColor("#617588");
    return t;
}

theme make_night() {
    theme t;
    t.dark = true;
    t.page = QColor("#09131b"), t.card = QColor("#111e29"), t.field = QColor("#0d1822"), t.ink = QColor("#e3ecf3"),
    t.ink2 = QColor("#a3b7c6"), t.ink3 = QColor("#7f96a8"), t.line = QColor("#213441");
    t.accent = QColor("#5bb0ee"), t.good = QColor("#4fd093"), t.warn = QColor("#ffcf6e"),
    t.warn_back = QColor("#3a2a0a"), t.bad = QColor("#ff9d92"), t.bad_back = QColor("#481611"),
    t.notice_back = QColor("#142c40");
    t.sea = QColor("#0b2130"), t.shore1 = QColor("#13324a"), t.shore2 = QColor("#102b3f"), t.shore3 = QColor("#0d2637"),
    t.land = QColor("#242f36"), t.coast = QColor("#56707f"), t.place = QColor("#a0b1bc"),
    t.sea_text = QColor("#6594ae"), t.graticule = QColor("#21455b");
    t.route = QColor("#8ba6ba"), t.leg = QColor("#ff8a5c"), t.draft = QColor("#c79bf2"), t.no_go = QColor("#5d2a2a"),
    t.true_wind = QColor("#f2b05e"), t.apparent_wind = QColor("#4fd1c0"), t.hull = QColor("#ff7d4d"),
    t.deck = QColor("#4a2216");
    t.links[0] = QColor("#5bb8f5"), t.links[1] = QColor("#5fd699"), t.links[2] = QColor("#e08acb"),
    t.link_other = QColor("#7f96a8");
    return t;
}

theme make_red() {
    theme t;
    t.dark = true;
    t.page = QColor("#060000"), t.card = QColor("#0d0000"), t.field = QColor("#090000"), t.ink = QColor("#ff6a5c"),
    t.ink2 = QColor("#ff4436"), t.ink3 = QColor("#f61a10"), t.line = QColor("#3a0500");
    t.accent = QColor("#ff7a5e"), t.good = QColor("#ff5a3c"), t.warn = QColor("#ff9478"),
    t.warn_back = QColor("#2a0800"), t.bad = QColor("#ffa58e"), t.bad_back = QColor("#4a0600"),
    t.notice_back = QColor("#200300");
    t.sea = QColor("#080000"), t.shore1 = QColor("#140100"), t.shore2 = QColor("#100100"), t.shore3 = QColor("#0c0000"),
    t.land = QColor("#1e0300"), t.coast = QColor("#9c2012"), t.place = QColor("#ff4a38"),
    t.sea_text = QColor("#ff3426"), t.graticule = QColor("#3c0600");
    t.route = QColor("#e0402e"), t.leg = QColor("#ff8a6a"), t.draft = QColor("#ffb09a"), t.no_go = QColor("#4a0a04"),
    t.true_wind = QColor("#ff8066"), t.apparent_wind = QColor("#ff5040"), t.hull = QColor("#ff5a40"),
    t.deck = QColor("#3a0c04");
    t.links[0] = QColor("#ff5646"), t.links[1] = QColor("#ffa28a"), t.links[2] = QColor("#d42014");
    t.link_other = QColor("#f61a10");
    return t;
}

theme make(palette which) {
    switch (which) {
        case palette::night: return make_night();
        case palette::red: return make_red();
        case palette::day: break;
    }
    return make_day();
}

theme& current() {
    static theme used = make_day();
    return used;
}

QString style_sheet(const theme& t) {
    auto c = [](const QColor& of) { return of.name(); };
    return QStringLiteral(R"(
QWidget { color: %1; }
QMainWindow, QDialog, QScrollArea, QScrollArea > QWidget > QWidget { background: %2; }
QScrollArea { border: 2px solid transparent; border-radius: 9px; }
QScrollArea:focus { border-color: %7; }
QFrame#card, QWidget#card { background: %3; border: 1px solid %4; border-radius: 9px; }
QLabel { background: transparent; }
QLabel[role="small"] { color: %6; }
QLabel[role="head"] { color: %5; font-weight: 600; }
QMenuBar { background: %3; border-bottom: 1px solid %4; padding: 1px 4px; }
QMenuBar::item { padding: 9px 7px; border-radius: 5px; background: transparent; }
QMenuBar::item:selected, QMenu::item:selected { background: %7; color: %3; }
QMenu { background: %3; border: 1px solid %4; padding: 4px; }
QMenu::item { padding: 5px 26px 5px 22px; border-radius: 5px; }
QMenu::item:disabled { color: %6; }
QMenu::separator { height: 1px; background: %4; margin: 4px 8px; }
QPushButton, QToolButton { background: %8; border: 1px solid %4; border-radius: 7px; padding: 5px 9px; min-height: 18px; }
QPushButton:hover, QToolButton:hover { border-color: %7; }
QPushButton:pressed, QToolButton:pressed { background: %4; }
QPushButton:checked, QToolButton:checked { background: %7; border-color: %7; color: %3; }
QPushButton:disabled, QToolButton:disabled { color: %6; background: transparent; }
QPushButton[role="primary"] { background: %7; color: %3; border-color: %7; font-weight: 600; }
QPushButton[role="primary"]:disabled { background: %4; color: %6; border-color: %4; }
QPushButton[role="danger"] { color: %9; }
QPushButton:focus, QToolButton:focus { border: 2px solid %7; padding: 4px 8px; }
QPushButton:checked:focus, QToolButton:checked:focus, QPushButton[role="primary"]:focus { border-color: %1; }
QComboBox, QLineEdit, QDoubleSpinBox { background: %8; border: 1px solid %4; border-radius: 7px; padding: 3px 8px; min-height: 20px; selection-background-color: %7; selection-color: %3; }
QComboBox:focus, QLineEdit:focus, QDoubleSpinBox:focus { border: 2px solid %7; padding: 2px 7px; }
QDoubleSpinBox[state="changed"] { border: 2px solid %7; padding: 2px 7px; font-weight: 600; }
QDoubleSpinBox[state="bad"] { border: 2px solid %9; padding: 2px 7px; color: %9; }
QComboBox::drop-down { border: 0; width: 22px; }
QComboBox::down-arrow { image: none; }
QComboBox QAbstractItemView { background: %3; border: 1px solid %4; selection-background-color: %7; selection-color: %3; }
QTabWidget::pane { border: 0; top: 4px; }
QTabBar { background: transparent; }
QTabBar::tab { background: transparent; color: %5; padding: 5px 5px; margin-right: 1px; border: 1px solid transparent; border-radius: 7px; font-size: 14px; }
QTabBar::tab:selected { background: %3; color: %1; font-weight: 600; border: 1px solid %4; }
QTabBar::tab:hover:!selected { color: %7; }
QTabBar::tab:selected:focus { border: 2px solid %7; padding: 4px 5px; }
QTableView, QPlainTextEdit, QTextEdit { background: %3; alternate-background-color: %8; border: 1px solid %4; border-radius: 9px; gridline-color: %4; selection-background-color: %10; selection-color: %1; }
QTableView:focus, QPlainTextEdit:focus { border: 2px solid %7; }
QTableView::item { padding: 2px 5px; }
QHeaderView { background: transparent; border: 0; }
QHeaderView::section { background: %3; color: %6; border: 0; border-bottom: 1px solid %4; padding: 4px 5px; }
QHeaderView::section:vertical { border: 0; padding: 0 8px; }
QTableCornerButton::section { background: %3; border: 0; }
QProgressBar { background: %8; border: 1px solid %4; border-radius: 5px; height: 8px; text-align: center; }
QProgressBar::chunk { background: %7; border-radius: 4px; }
QScrollBar:vertical { background: transparent; width: 9px; margin: 1px; } QScrollBar:horizontal { background: transparent; height: 9px; margin: 1px; }
QScrollBar::handle { background: %4; border-radius: 3px; min-height: 26px; min-width: 26px; }
QScrollBar::add-line, QScrollBar::sub-line { width: 0; height: 0; } QScrollBar::add-page, QScrollBar::sub-page { background: transparent; }
QSplitter::handle { background: transparent; }
QToolTip { background: %1; color: %3; border: 0; padding: 4px 7px; }
)")
        .arg(c(t.ink), c(t.page), c(t.card), c(t.line), c(t.ink2), c(t.ink3), c(t.accent), c(t.field), c(t.bad))
        .arg(c(t.notice_back));
}

} // namespace

const QColor& theme::of(freshness how) const {
    switch (how) {
        case freshness::fresh: return good;
        case freshness::ageing:
        case freshness::stale: return warn; // red is for alarms
        case freshness::none: break;
    }
    return ink3;
}

const QColor& theme::of(severity how) const {
    switch (how) {
        case severity::critical: return bad;
        case severity::warning: return warn;
        case severity::notice: break;
    }
    return accent;
}

const QColor& theme::ink_of(freshness how) const {
    switch (how) {
        case freshness::fresh: return ink;
        case freshness::ageing: return ink2;
        case freshness::stale:
        case freshness::none: break;
    }
    return ink3;
}

const theme& colours() { return current(); }

QLabel* rich_label(QWidget* parent) {
    auto* made = new QLabel(parent);
    made->setTextFormat(Qt::RichText);
    return made;
}

void show_texts_plainly() {
    // Qt guesses for each text whether it is markup. A tooltip is also a label.
    struct plain : QObject {
        using QObject::QObject;
        bool eventFilter(QObject* what, QEvent* event) override {
            auto* label = event->type() == QEvent::Polish ? qobject_cast<QLabel*>(what) : nullptr;
            if (label && label->textFormat() == Qt::AutoText) label->setTextFormat(Qt::PlainText);
            return false;
        }
    };
    static QPointer<plain> filter; // of this application
    if (filter) return;
    filter = new plain(qApp);
    qApp->installEventFilter(filter);
}

void use_theme(palette which) {
    current() = make(which);
    const auto& t = current();
    QPalette palette;
    palette.setColor(QPalette::Window, t.page);
    palette.setColor(QPalette::WindowText, t.ink);
    palette.setColor(QPalette::Base, t.card);
    palette.setColor(QPalette::AlternateBase, t.field);
    palette.setColor(QPalette::Text, t.ink);
    palette.setColor(QPalette::Button, t.field);
    palette.setColor(QPalette::ButtonText, t.ink);
    palette.setColor(QPalette::Highlight, t.accent);
    palette.setColor(QPalette::HighlightedText, t.card);
    palette.setColor(QPalette::PlaceholderText, t.ink3);
    palette.setColor(QPalette::ToolTipBase, t.ink);
    palette.setColor(QPalette::ToolTipText, t.card);
    QApplication::setStyle(QStyleFactory::create("Fusion"));
    QApplication::setPalette(palette);
    QApplication::setFont(font_of(smallest_text));
    qApp->setStyleSheet(style_sheet(t));
    for (auto* each : QApplication::allWidgets()) each->update();
}

QFont font_of(int pixels, QFont::Weight weight) {
    static const QString family = [] {
        auto all = QFontDatabase::families();
        for (const char* wanted : {"Inter", "Noto Sans", "Cantarell", "DejaVu Sans"})
            if (all.contains(wanted)) return QString(wanted);
        return QApplication::font().family();
    }();
    QFont made(family);
    made.setPixelSize(std::max(pixels, smallest_text));
    made.setWeight(weight);
    made.setStyleStrategy(QFont::PreferAntialias);
    return made;
}

QString text(const std::string& utf8) { return QString::fromUtf8(utf8.data(), static_cast<qsizetype>(utf8.size())); }

} // namespace atirma::console
