#include "links_panel.hpp"

#include "theme.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <QLabel>
#include <QVBoxLayout>

namespace atirma::console {

node_card::node_card(const std::string& path, QWidget* parent) : QFrame(parent) {
    setObjectName("card");
    auto* column = new QVBoxLayout(this);
    column->setContentsMargins(11, 7, 11, 8);
    column->setSpacing(3);
    auto* top = new QHBoxLayout;
    auto* head = new QLabel(tr("Node %1").arg(text(operator_label(path))), this);
    head->setFont(font_of(13, QFont::DemiBold));
    head->setToolTip(tr("%1: a communication node. It stores every packet, and sends the telecommands over the links")
                         .arg(text(path)));
    state_ = rich_label(this);
    state_->setAlignment(Qt::AlignRight | Qt::AlignVCenter);
    state_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
    top->addWidget(head);
    top->addWidget(state_, 1);
    column->addLayout(top);
    words_ = rich_label(this);
    words_->setProperty("role", "small");
    words_->setFont(font_of(11));
    words_->setWordWrap(true);
    column->addWidget(words_);
}

void node_card::show_node(const node_view& node, utc_time now) {
    const auto& t = colours();
    bool good = node.connected && node.state && node.state->trouble.empty();
    auto what = !node.connected                ? tr("not reached")
                : !node.state                  ? tr("reached")
                : !node.state->trouble.empty() ? tr("in trouble")
                : node.state->serving          ? tr("serves")
                                               : tr("not serving yet");
    state_->setText(QStringLiteral("<span style='color:%1'>● %2</span>").arg((good ? t.good : t.bad).name(), what));
    state_->setToolTip(text(node.trouble));
    if (!node.state) return words_->setText(text(node.trouble).toHtmlEscaped());
    const auto& s = *node.state;
    auto words = tr("%1 packets stored · %2 duplicates").arg(s.packets).arg(s.duplicates);
    if (s.held) words += tr(" · %1 waiting for the disk").arg(s.held);
    if (s.telecommands_open) words += tr(" · %1 commands open").arg(s.telecommands_open);
    if (!s.peer.empty())
        words += !s.peer_lives        ? tr(" · <span style='color:%1'>alone</span>").arg(t.warn.name())
                 : s.peer_misses > 20 ? tr(" · its peer lacks %1").arg(s.peer_misses)
                                      : tr(" · backed");
    if (!s.trouble.empty())
        words +=
            QStringLiteral("<br><span style='color:%1'>%2</span>").arg(t.bad.name(), text(s.trouble).toHtmlEscaped());
    if (!node.connected && node.told_at)
        words += tr("<br>reported %1 ago").arg(text(age_text(age_s(now, *node.told_at))));
    words_->setText(words);
}

} // namespace atirma::console
