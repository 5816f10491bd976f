#include "helm_bar.hpp"

#include "choice_box.hpp"
#include "lists.hpp"
#include "theme.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <QComboBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>

namespace atirma::console {

helm_bar::helm_bar(operator_actions& actions, QWidget* parent) : QWidget(parent), actions_(actions) {
    auto* row = new QHBoxLayout(this);
    row->setContentsMargins(0, 0, 0, 0);
    row->setSpacing(4);
    const std::pair<sailing_mode, QString> modes[] = {
        {sailing_mode::automatic, tr("Sails the waypoints (Ctrl+1)")},
        {sailing_mode::hold, tr("Keeps its heading, for the time of the parameter heading time limit at most; then it "
                                "loiters (Ctrl+2)")},
        {sailing_mode::station_keep, tr("Stays around its present place (Ctrl+3)")},
        {sailing_mode::return_home, tr("Return to launch: sails home and stays there (Ctrl+4)")},
        {sailing_mode::manual, tr("Steered by the remote control (Ctrl+5); asks for confirmation")},
    };
    for (const auto& [mode, tip] : modes) {
        auto* button = new QPushButton(text(label(mode)), this);
        button->setCheckable(true);
        button->setToolTip(tip);
        button->setObjectName(QStringLiteral("mode_%1").arg(static_cast<int>(mode)));
        connect(button, &QPushButton::clicked, this, [this, button, which = mode] {
            button->setChecked(!button->isChecked()); // only a report of the boat switches it
            actions_.set_mode(which);
        });
        row->addWidget(button);
        modes_.emplace_back(mode, button);
    }
    row->addSpacing(6);
    auto add = [&](const QString& name, const QString& tip, boat_command command) {
        auto* button = new QPushButton(name, this);
        button->setToolTip(tip);
        button->setObjectName("do_" + name.toLower());
        connect(button, &QPushButton::clicked, this, [this, command] { actions_.give(command); });
        row->addWidget(button);
    };
    add(tr("Tack"), tr("Turns through the wind now (Ctrl+T)"), commands::tack_now());
    add(tr("Gybe"), tr("Turns away from the wind and round now (Ctrl+G)"), commands::gybe_now());
    add(tr("Ping"), tr("Requests an answer from the boat (Ctrl+P)"), commands::ping());
    last_ = rich_label(this);
    last_->setObjectName("last_command");
    last_->setMinimumWidth(60);
    last_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
    row->addSpacing(6);
    row->addWidget(last_, 1);
    link_ = new choice_box(this);
    link_->setObjectName("link_choice");
    link_->setToolTip(tr("The link that carries commands"));
    link_->setAccessibleName(tr("The link that carries commands"));
    link_->addItem(tr("Best link"), QString());
    link_->setMinimumWidth(96);
    connect(link_, &QComboBox::activated, this,
            [this](int index) { actions_.choose_link(link_->itemData(index).toString().toStdString()); });
    row->addWidget(link_);
}

void helm_bar::show_snapshot(const snapshot& seen, utc_time now) {
    const auto& sailing = seen.boat.sailing;
    auto how = freshness_of(sailing, value_kind::sailing, seen.boat, now);
    bool known = (how == freshness::fresh || how == freshness::ageing) && !seen.boat.on_beacon();
    for (auto& [mode, button] : modes_) button->setChecked(known && sailing->value.mode == mode);
    for (const auto& link : seen.links) {
        if (!link.takes_commands || link.all_links) continue;
        auto name = text(label(link));
        if (int at = link_->findData(text(link.path)); at < 0) link_->addItem(name, text(link.path));
        else link_->setItemText(at, name);
    }
    const command_entry* last = nullptr;
    for (const auto& one : *seen.commands)
        if (one.own) last = &one;
    if (!last) return last_->setText(QString());
    auto words = text(last->what) + ": " + phase_text(*last, now);
    auto shown = QFontMetrics(last_->font()).elidedText(words, Qt::ElideRight, std::max(40, last_->width() - 16));
    last_->setText(
        QStringLiteral("<span style='color:%1'>●</span> %2").arg(colour_of(last->phase).name(), shown.toHtmlEscaped()));
    last_->setToolTip(words + (last->text.empty() ? QString() : "\n" + text(last->text)));
}

} // namespace atirma::console
