#include "command_button.hpp"

#include "theme.hpp"

#include <components/gui_client/track_store.hpp>
#include <components/gui_client/words.hpp>

#include <ise/core/time_text.hpp>

#include <QMenu>

#include <algorithm>

namespace atirma::console {

command_button::command_button(operator_actions& actions, QWidget* parent) : QToolButton(parent), actions_(actions) {
    setObjectName("command");
    setPopupMode(QToolButton::InstantPopup);
    setToolButtonStyle(Qt::ToolButtonTextOnly);
    auto* menu = new QMenu(this);
    menu->setObjectName("command_menu");
    setMenu(menu);
    connect(menu, &QMenu::aboutToShow, this, &command_button::fill_menu);
    // One width for all of its texts: it does not move under the mouse.
    setFixedWidth(QFontMetrics(font_of(smallest_text, QFont::DemiBold)).horizontalAdvance("maria has authority") + 22);
    auto kept = sizePolicy();
    kept.setRetainSizeWhenHidden(true);
    setSizePolicy(kept);
    hide();
}

void command_button::ask_for(authority_action what, const std::string& to, bool confirmed) {
    change_authority change;
    change.request.action = what;
    change.request.to = to;
    change.request.confirmed = confirmed;
    actions_.act(std::move(change));
}

void command_button::fill_menu() {
    auto* to = menu();
    to->clear();
    const auto& holder = seen_.state.holder;
    auto name = console::text(operator_label(holder));
    if (seen_.mine()) {
        for (const auto& who : seen_.state.asked_by)
            connect(to->addAction(tr("Hand over to %1, who requests it").arg(console::text(operator_label(who)))),
                    &QAction::triggered, this, [this, who] { ask_for(authority_action::hand_over, who); });
        for (const auto& who : others_)
            if (std::ranges::count(seen_.state.asked_by, who) == 0)
                connect(to->addAction(tr("Hand over to %1").arg(console::text(operator_label(who)))),
                        &QAction::triggered, this, [this, who] { ask_for(authority_action::hand_over, who); });
        if (!to->isEmpty()) to->addSeparator();
        connect(to->addAction(tr("Give it up")), &QAction::triggered, this,
                [this] { ask_for(authority_action::release); });
    } else if (holder.empty()) {
        connect(to->addAction(tr("Take the authority over the boat")), &QAction::triggered, this,
                [this] { ask_for(authority_action::take); });
    } else {
        auto* ask = to->addAction(tr("Request it from %1").arg(name));
        ask->setEnabled(std::ranges::count(seen_.state.asked_by, seen_.self) == 0);
        connect(ask, &QAction::triggered, this, [this] { ask_for(authority_action::ask); });
        connect(to->addAction(tr("Take it from %1…").arg(name)), &QAction::triggered, this, [this, name] {
            if (actions_.confirmed(tr("Take the authority from %1?").arg(name),
                                   tr("%1 cannot continue then. If there is time, request it first.").arg(name)))
                ask_for(authority_action::take, {}, true);
        });
    }
    if (seen_.state.since != utc_time()) {
        to->addSeparator();
        auto* result = to->addAction(
            tr("%1 UTC: %2")
                .arg(console::text(ise::iso_8601(seen_.state.since).substr(11, 5)), console::text(seen_.state.how)));
        result->setEnabled(false);
    }
}

void command_button::show_snapshot(const snapshot& seen) {
    const auto& t = colours();
    seen_ = seen.authority;
    others_.clear();
    for (const auto& one : *seen.present)
        if (one.console && !one.self) others_.push_back(one.path);
    setVisible(seen_.known);
    if (!seen_.known) return;
    const auto& holder = seen_.state.holder;
    QColor ink = t.ink2, back = t.field;
    QString words = tr("no authority held");
    bool reached = seen.nodes.empty() || std::ranges::any_of(seen.nodes, &node_view::connected);
    if (!reached) {
        words = tr("authority not known");
        ink = t.warn, back = t.warn_back;
    } else if (seen_.changing) words = tr("asking…");
    else if (seen_.mine() && !seen_.state.asked_by.empty()) {
        words = tr("%1 asks for it").arg(console::text(operator_label(seen_.state.asked_by.front())));
        ink = t.warn, back = t.warn_back;
    } else if (seen_.mine()) {
        words = tr("you have authority");
        ink = t.good;
    } else if (!holder.empty()) {
        words = tr("%1 has authority").arg(console::text(operator_label(holder)));
        ink = t.warn, back = t.warn_back;
    }
    setText(QFontMetrics(font_of(smallest_text, QFont::DemiBold)).elidedText(words, Qt::ElideMiddle, width() - 20));
    setToolTip(seen_.problem.empty()
                   ? words + "\n" +
                         (reached ? tr("The operator whose telecommands the boat accepts; click to change")
                                  : tr("No communication node is reached; the last holder that one reported: %1")
                                        .arg(holder.empty() ? tr("nobody") : console::text(operator_label(holder))))
                   : console::text(seen_.problem));
    auto sheet =
        QStringLiteral("QToolButton { color: %1; background: %2; border: 0; border-radius: 10px; padding: 2px 10px; "
                       "min-height: 16px; font-weight: 600; } QToolButton::menu-indicator { image: none; }")
            .arg(ink.name(), back.name());
    if (styleSheet() != sheet) setStyleSheet(sheet);
}

} // namespace atirma::console
