#include "links_panel.hpp"

#include "link_details.hpp"
#include "theme.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <QGridLayout>
#include <QLabel>
#include <QScrollArea>

#include <algorithm>

namespace atirma::console {
namespace {

QString seal_text(const link_view& link, utc_time now) {
    const auto& t = colours();
    const auto* seal = link.seal();
    if (!seal) return QStringLiteral("–");
    auto coloured = [](const QColor& colour, const QString& words) {
        return QStringLiteral("<span style='color:%1'>%2</span>").arg(colour.name(), words);
    };
    if (!seal->sealed) return coloured(t.warn, QLabel::tr("not sealed: anybody with a radio can command the boat"));
    auto age = seal->verified_at ? text(age_text(age_s(now, *seal->verified_at))) : QString();
    auto words = !seal->verified_at ? coloured(t.warn, QLabel::tr("sealed, boat not verified yet"))
                 : age == "now"     ? QLabel::tr("sealed, boat verified now")
                                    : QLabel::tr("sealed, boat verified %1 ago").arg(age);
    words += QLabel::tr(" · key %1, epoch %2").arg(text(seal->key).toHtmlEscaped(), QString::number(seal->epoch));
    if (seal->next_epoch) words += coloured(t.warn, QLabel::tr(" · changing to epoch %1").arg(*seal->next_epoch));
    if (seal->refused > 0) words += coloured(t.warn, QLabel::tr(" · %1 refused").arg(seal->refused));
    return words;
}

} // namespace

link_card::link_card(std::string path, operator_actions& actions, QWidget* parent)
    : QFrame(parent), path_(std::move(path)), actions_(actions) {
    setObjectName("card");
    auto* column = new QVBoxLayout(this);
    column->setContentsMargins(11, 8, 11, 9);
    column->setSpacing(5);
    auto* top = new QHBoxLayout;
    head_ = rich_label(this);
    head_->setFont(font_of(15, QFont::DemiBold));
    head_->setToolTip(text(path_));
    state_ = rich_label(this);
    state_->setObjectName("link_state");
    state_->setAlignment(Qt::AlignRight | Qt::AlignVCenter);
    state_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
    top->addWidget(head_);
    top->addWidget(state_, 1);
    column->addLayout(top);
    value_grid values(this);
    heard_ = values.add(tr("Boat heard"), tr("The last packet of the boat over this link"));
    signal_ = values.add(tr("Signal"), tr("Here / at the boat: strength of the last packet"));
    packets_ = values.add(tr("Packets"),
                          tr("Telemetry over this link; in brackets packets received over another link before"));
    lost_ = values.add(tr("Lost, bad"), tr("Published but not received here; damaged"));
    queue_ = values.add(tr("Boat's queue"),
                        tr("Waiting at the boat for this link; in brackets dropped because the queue was full"));
    commands_ = values.add(tr("Commands open"), tr("Telecommands that the boat has not answered yet"));
    traffic_ = values.add(tr("Traffic"), tr("Bytes received; for Iridium the credits, one for each 50 bytes begun"));
    boat_side_ = values.add(tr("Boat sent, failed"), tr("By the boat's own counters"));
    seal_ = values.add(tr("Seal"),
                       tr("Whether packets over this link are sealed with the radio's key, and the last packet that "
                          "proved to be of the boat"),
                       true);
    seal_->setObjectName("link_seal");
    column->addLayout(values.layout());
    column_ = column;
}

bool link_card::show_link(const link_view& link, const boat_view& boat, utc_time now) {
    const auto& t = colours();
    head_->setText(QStringLiteral("<span style='color:%1'>▬</span> %2")
                       .arg((link.link ? t.of(*link.link) : t.link_other).name(), text(label(link)).toHtmlEscaped()));
    auto trouble = !link.trouble.empty() ? link.trouble
                   : link.xbee           ? link.xbee->trouble
                   : link.gprs           ? link.gprs->trouble
                   : link.account        ? link.account->trouble
                                         : std::string();
    auto how = freshness::none;
    if (link.last_heard)
        how = judge(age_s(now, *link.last_heard), boat.rhythm.position_s(link.link.value_or(link_id::xbee)));
    auto colour = !link.connected || !trouble.empty() ? t.bad : t.of(how);
    auto words = !link.connected           ? tr("not reached: %1").arg(text(trouble))
                 : !trouble.empty()        ? text(trouble)
                 : how == freshness::none  ? tr("boat not heard yet")
                 : how == freshness::fresh ? tr("live")
                                           : tr("silent");
    auto shown = QFontMetrics(state_->font()).elidedText(words, Qt::ElideRight, std::max(120, state_->width() - 18));
    state_->setText(QStringLiteral("<span style='color:%1'>● %2</span>").arg(colour.name(), shown.toHtmlEscaped()));
    state_->setToolTip(words);
    heard_->setText(link.last_heard ? QStringLiteral("<span style='color:%1'>%2</span>")
                                          .arg(t.of(how).name(), text(age_text(age_s(now, *link.last_heard))))
                                    : "–");
    std::optional<heard<link_status>> there;
    if (link.link && static_cast<std::size_t>(*link.link) < link_count)
        there = boat.links[static_cast<std::size_t>(*link.link)];
    auto dbm = [](int value) {
        return value ? QStringLiteral("%1").arg(value).replace('-', QChar(0x2212)) : QStringLiteral("–");
    };
    auto here = link.xbee ? link.xbee->rssi_dbm.value_or(0) : 0, at_boat = there ? there->value.rssi_dbm : 0;
    // GPRS and Iridium modems do not report it, unless the boat does.
    signal_->setText(link.xbee || here || at_boat ? QStringLiteral("%1 / %2 dBm").arg(dbm(here), dbm(at_boat))
                                                  : tr("not reported"));
    packets_->setText(QStringLiteral("%1 (%2)").arg(link.packets).arg(link.duplicates));
    lost_->setText(QStringLiteral("%1, %2").arg(link.lost).arg(link.malformed));
    queue_->setText(there ? QStringLiteral("%1 (%2)").arg(there->value.queued).arg(there->value.dropped) : "–");
    auto cost = link.credits ? tr(" · %1 credits").arg(link.credits) : QString();
    if (link.account) {
        const auto& a = *link.account;
        cost = tr(" · %1 credits").arg(a.today.mo_credits + a.today.mt_credits);
        traffic_->setToolTip(tr("Credits: today %1 from the boat and %2 to it, this month %3; budget for telecommands "
                                "today: %4")
                                 .arg(a.today.mo_credits)
                                 .arg(a.today.mt_credits)
                                 .arg(a.this_month.mo_credits + a.this_month.mt_credits)
                                 .arg(a.daily_budget ? QString::number(*a.daily_budget) : tr("no limit")));
    }
    traffic_->setText(text(bytes_text(link.bytes)) + cost);
    boat_side_->setText(there ? QStringLiteral("%1, %2").arg(there->value.sent).arg(there->value.failed) : "–");
    commands_->setText(QString::number(link.open_commands));
    seal_->setText(seal_text(link, now));
    bool grown = false;
    if (!details_) {
        details_ = link_details::make(link, actions_, this);
        grown = details_ != nullptr;
        if (grown) column_->addWidget(details_);
    }
    if (details_) details_->show_link(link, now);
    return grown;
}

QWidget* link_card::follow_in_tab_order(QWidget* before) {
    for (auto* each : findChildren<QWidget*>()) {
        // The list of a combo box is a window.
        if (!(each->focusPolicy() & Qt::TabFocus) || each->window() != window()) continue;
        setTabOrder(before, each);
        before = each;
    }
    return before;
}

links_panel::links_panel(operator_actions& actions, QWidget* parent) : QWidget(parent), actions_(actions) {
    auto* outer = new QVBoxLayout(this);
    outer->setContentsMargins(0, 2, 0, 0);
    area_ = new QScrollArea(this);
    area_->setWidgetResizable(true);
    area_->setAccessibleName(tr("Links"));
    area_->setFrameShape(QFrame::NoFrame);
    area_->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
    auto* inside = new QWidget;
    inside->setMinimumWidth(1); // cards are as wide as the panel, also in a narrow window
    column_ = new QVBoxLayout(inside);
    column_->setContentsMargins(0, 0, 2, 0);
    column_->setSpacing(6);
    empty_ = new QLabel(
        tr("No link to a boat is running yet. It is shown here as soon as its proxy registers with the name server."),
        inside);
    empty_->setWordWrap(true);
    empty_->setProperty("role", "small");
    column_->addWidget(empty_);
    column_->addStretch(1);
    area_->setWidget(inside);
    outer->addWidget(area_);
}

void links_panel::show_snapshot(const snapshot& seen, utc_time now) {
    empty_->setVisible(seen.links.empty() && seen.nodes.empty());
    for (const auto& node : seen.nodes) {
        auto& card = nodes_[node.path];
        if (!card) column_->insertWidget(column_->count() - 1, card = new node_card(node.path, this));
        card->show_node(node, now);
    }
    std::vector<const link_view*> links;
    for (const auto& link : seen.links)
        if (!link.all_links) links.push_back(&link);
    std::ranges::stable_sort(links, {}, [](const auto* of) { return of->link ? static_cast<int>(*of->link) : 100; });
    int place = 1; // below the text that is shown without links
    bool grown = false;
    for (const auto* each : links) {
        const auto& link = *each;
        auto& card = cards_[link.path];
        if (!card) {
            card = new link_card(link.path, actions_, this);
            column_->insertWidget(place, card);
        }
        ++place;
        grown |= card->show_link(link, seen.boat, now);
    }
    if (!grown) return;
    // A widget created later is last in the tab order, behind all other lists.
    QWidget* before = area_;
    for (const auto* each : links) before = cards_[each->path]->follow_in_tab_order(before);
}

} // namespace atirma::console
